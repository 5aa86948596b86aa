// Values by row and time, as areas of one colour with an opacity.
import { drawnToFit, h, svg } from "../dom.js";
import { range, short } from "../numbers.js";
import { horizontalAxis, marks, scale } from "./axes.js";

const ROW = 15;
const LEVELS = 12;

export function heat(chart) {
  const xs = range([...chart.begin, ...chart.end]);
  const element = h(
    "div",
    {},
    drawnToFit(h("div", { class: "plot" }), (width) => drawn(chart, xs, width)),
    h("p", { class: "label axis" }, chart.x_label),
    h("p", { class: "label" }, `${chart.value_label}; the strongest colour is ${short(chart.largest)} or more`),
  );
  return { element, table: () => table(chart) };
}

function drawn(chart, xs, width) {
  const longest = Math.max(...chart.rows.map((row) => row.label.length));
  const left = Math.min(width * 0.5, longest * 6.4 + 10);
  const top = chart.marks.length ? 30 : 8;
  const frame = { left, right: width - 10, top, bottom: top + ROW * chart.rows.length };
  const x = scale(xs, frame.left, frame.right);
  const height = frame.bottom + 24;
  return svg(
    "svg",
    { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": `${chart.title}. The data follow as a table.` },
    chart.rows.map((row, i) =>
      svg("text", { x: left - 6, y: frame.top + ROW * i + 11, "text-anchor": "end" }, row.label),
    ),
    levels(chart, x, frame),
    marks(chart.marks, x, { ...frame, top: 14 }, 11),
    horizontalAxis(x, xs, frame),
  );
}

/** One path for each level of opacity, instead of one element for each cell. */
function levels(chart, x, frame) {
  const paths = Array.from({ length: LEVELS + 1 }, () => "");
  chart.rows.forEach((row, i) => {
    const top = frame.top + ROW * i;
    row.values.forEach((value, k) => {
      if (value === null) return;
      const level = Math.round(Math.min(1, value / chart.largest) * LEVELS);
      const [from, to] = [x(chart.begin[k]), x(chart.end[k])];
      paths[level] += `M${from.toFixed(1)} ${top}H${to.toFixed(1)}V${top + ROW - 1}H${from.toFixed(1)}Z`;
    });
  });
  return paths.map((d, level) => svg("path", { class: "heat", d, "fill-opacity": level / LEVELS }));
}

function table(chart) {
  return {
    columns: ["begin, s", "end, s", ...chart.rows.map((row) => row.label)],
    rows: chart.begin.map((begin, k) => [begin, chart.end[k], ...chart.rows.map((row) => row.values[k])]),
  };
}
