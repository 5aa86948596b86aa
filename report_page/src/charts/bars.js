// Horizontal bars in groups.
import { h, prose } from "../dom.js";
import { range, short } from "../numbers.js";

export function bars(chart) {
  const [low, high] = range(chart.groups.flatMap((group) => group.values), [0]);
  const share = (value) => ((value - low) / (high - low)) * 100;
  const several = chart.names.length > 1;
  const element = h(
    "div",
    { class: "bars" },
    chart.groups.map((group) =>
      h(
        "div",
        { class: "group" },
        h("div", { class: "name" }, prose(group.label)),
        h(
          "div",
          { class: "tracks" },
          group.values.map((value, i) =>
            value === null && several ? null : bar(value, i, share, chart.names[i], group.notes[i]),
          ),
        ),
      ),
    ),
    h("p", { class: "label" }, chart.x_label),
    several ? key(chart.names) : null,
  );
  return { element, table: () => table(chart) };
}

function bar(value, i, share, name, note) {
  const zero = share(0);
  const at = value === null ? zero : share(value);
  const [left, right] = [Math.min(zero, at), Math.max(zero, at)];
  return h(
    "div",
    { class: "track", title: name },
    h("div", { class: note ? `fill s${i} noted` : `fill s${i}`, style: { left: `${left}%`, width: `${right - left}%` } }),
    h("span", { class: "value", style: { left: `${right}%` } }, [value === null ? "diverged" : short(value), note].filter(Boolean).join(", ")),
  );
}

function key(names) {
  return h(
    "ul",
    { class: "legend" },
    names.map((name, i) => h("li", {}, h("span", { class: `swatch fill s${i}`, "aria-hidden": "true" }), name)),
  );
}

function notes(chart, group) {
  return chart.names.flatMap((name, i) => (group.notes[i] ? [`${name}: ${group.notes[i]}`] : [])).join("; ");
}

function table(chart) {
  const noted = chart.groups.some((group) => group.notes.some(Boolean));
  return {
    columns: ["", ...chart.names.map((name) => `${name}: ${chart.x_label}`), ...(noted ? ["note"] : [])],
    rows: chart.groups.map((group) => [group.label, ...group.values, ...(noted ? [notes(chart, group)] : [])]),
  };
}
