// Values with intervals, one below the other.
import { h } from "../dom.js";
import { range, short } from "../numbers.js";

export function intervals(chart) {
  const reference = chart.reference === null ? [] : [chart.reference];
  const ends = chart.estimates.flatMap((one) => [one.low, one.high, one.value]);
  const [low, high] = chart.limits ?? range(ends, reference);
  const noted = chart.estimates.some((one) => one.note) ? "; an open point has a note in the table" : "";
  const share = (value) => `${((value - low) / (high - low)) * 100}%`;
  const element = h(
    "div",
    { class: "rows" },
    chart.estimates.map((one) =>
      h(
        "div",
        { class: "row" },
        h("div", { class: "name" }, one.label),
        h(
          "div",
          { class: "lane" },
          reference.map((value) => h("div", { class: "reference", style: { left: share(value) } })),
          one.low === null ? null : h("div", { class: "whisker", style: { left: share(one.low), width: `calc(${share(one.high)} - ${share(one.low)})` } }),
          h("div", { class: one.note ? "point open" : "point", style: { left: share(one.value) } }),
        ),
        h("div", { class: "value" }, one.low === null ? short(one.value) : `${short(one.value)} (${short(one.low)} to ${short(one.high)})`),
      ),
    ),
    h("p", { class: "label" }, `${chart.x_label}, from ${short(low)} to ${short(high)}${noted}`),
  );
  return { element, table: () => table(chart) };
}

function table(chart) {
  return {
    columns: ["quantity", "value", "low", "high", "note"],
    rows: chart.estimates.map((one) => [one.label, one.value, one.low, one.high, one.note]),
  };
}
