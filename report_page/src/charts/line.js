// Lines over a horizontal axis, with a legend.
import { drawnToFit, h, prose, svg } from "../dom.js";
import { range } from "../numbers.js";
import { horizontalAxis, marks, scale, verticalAxis } from "./axes.js";

const HEIGHT = 276;
const STYLES = 10;

export function line(chart) {
  const xs = range(chart.series.flatMap((one) => one.x), chart.marks.map((mark) => mark.value));
  const whole = chart.series.every((one) => one.x.every(Number.isInteger));
  const ys = range(chart.series.flatMap((one) => one.y), needsZero(chart) ? [0] : []);
  const plot = drawnToFit(h("div", { class: "plot" }), (width) => drawn(chart, xs, ys, width, whole));
  return { element: h("div", {}, plot, h("p", { class: "label axis" }, chart.x_label), legend(chart.series)), table: () => table(chart) };
}

/** Losses and distances begin at 0; scores may be negative. */
function needsZero(chart) {
  return chart.series.every((one) => one.y.every((value) => value === null || value >= 0));
}

function drawn(chart, xs, ys, width, whole) {
  const frame = { left: 48, right: width - 10, top: 38, bottom: HEIGHT - 24 };
  const x = scale(xs, frame.left, frame.right);
  const y = scale(ys, frame.bottom, frame.top);
  return svg(
    "svg",
    { viewBox: `0 0 ${width} ${HEIGHT}`, width, height: HEIGHT, role: "img", "aria-label": summary(chart) },
    verticalAxis(y, ys, frame, chart.y_label),
    marks(chart.marks, x, frame, frame.top - 5),
    chart.series.map((one, i) => [
      svg("path", { class: `series s${i % STYLES}`, d: path(one, x, y, breaks(chart)) }),
      one.x.length <= 40 ? dots(one, x, y, i) : null,
    ]),
    horizontalAxis(x, xs, frame, whole),
  );
}

/** A line is interrupted where a trial begins. */
function breaks(chart) {
  return chart.marks.filter((mark) => mark.low === null).map((mark) => mark.value);
}

function path(one, x, y, interruptions) {
  let d = "";
  let last = null;
  one.x.forEach((value, i) => {
    const at = one.y[i];
    const broken = last === null || interruptions.some((mark) => mark > last && mark <= value);
    if (at === null) {
      last = null;
      return;
    }
    d += `${broken ? "M" : "L"}${x(value).toFixed(1)} ${y(at).toFixed(1)}`;
    last = value;
  });
  return d;
}

function dots(one, x, y, i) {
  return one.x.map((value, k) =>
    one.y[k] === null
      ? null
      : svg("circle", { class: `dot s${i % STYLES}`, cx: x(value), cy: y(one.y[k]), r: 2.5 }),
  );
}

export function legend(series) {
  return h(
    "ul",
    { class: "legend" },
    series.map((one, i) =>
      h(
        "li",
        {},
        svg("svg", { width: 28, height: 10, "aria-hidden": "true" },
          svg("path", { class: `series s${i % STYLES}`, d: "M1 5H27" })),
        h("span", {}, prose(one.name)),
      ),
    ),
  );
}

function summary(chart) {
  const names = chart.series.map((one) => one.name).join(", ");
  return `${chart.title}. ${chart.y_label} over ${chart.x_label}: ${names}. The data follow as a table.`;
}

function table(chart) {
  const [first] = chart.series;
  const same = chart.series.every(
    (one) => one.x.length === first.x.length && one.x.every((value, i) => value === first.x[i]),
  );
  if (same) {
    return {
      columns: [chart.x_label, ...chart.series.map((one) => one.name)],
      rows: first.x.map((value, i) => [value, ...chart.series.map((one) => one.y[i])]),
    };
  }
  return {
    columns: ["line", chart.x_label, chart.y_label],
    rows: chart.series.flatMap((one) => one.x.map((value, i) => [one.name, value, one.y[i]])),
  };
}
