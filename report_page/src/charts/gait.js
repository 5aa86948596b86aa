// Contacts of sensors over time.
import { h } from "../dom.js";
import { text, ticks } from "../numbers.js";

export function gait(chart) {
  const share = (value) => `${(value / chart.end) * 100}%`;
  const element = h(
    "div",
    { class: "rows gait" },
    Object.entries(chart.groups).map(([group, lanes], g) =>
      h(
        "div",
        { role: "group", "aria-label": group },
        h("div", { class: "heading" }, group),
        lanes.map((lane) =>
          h(
            "div",
            { class: "row" },
            h("div", { class: "name" }, lane.label),
            h(
              "div",
              { class: "lane" },
              lane.spans.map(([begin, end]) =>
                h("div", { class: `fill s${g}`, style: { left: share(begin), width: `calc(${share(end)} - ${share(begin)})` } }),
              ),
            ),
          ),
        ),
      ),
    ),
    h(
      "div",
      { class: "row scale", "aria-hidden": "true" },
      h("div", { class: "name" }, "time, s"),
      h("div", { class: "lane" }, ticks(0, chart.end, 6).map((value) => h("span", { style: { left: share(value) } }, text(value)))),
    ),
  );
  return { element, table: () => table(chart) };
}

function table(chart) {
  return {
    columns: ["robot", "sensor", "contact from, s", "to, s"],
    rows: Object.entries(chart.groups).flatMap(([group, lanes]) =>
      lanes.flatMap((lane) => lane.spans.map(([begin, end]) => [group, lane.label, begin, end])),
    ),
  };
}
