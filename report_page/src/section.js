// A section of the report: heading, paragraphs, then charts, tables and pictures, each drawn alone.
import { h, prose } from "./dom.js";
import { bars } from "./charts/bars.js";
import { gait } from "./charts/gait.js";
import { heat } from "./charts/heat.js";
import { intervals } from "./charts/intervals.js";
import { line } from "./charts/line.js";
import { drawnAlone } from "./failure.js";
import { sortable } from "./table.js";

const CHARTS = { bars, gait, heat, intervals, line };

export function section(one) {
  const heading = `${one.key}-heading`;
  return h(
    "section",
    { id: one.key, "aria-labelledby": heading },
    h("h2", { id: heading }, one.title),
    drawnAlone("The text of this section", () => one.text.map((paragraph) => h("p", {}, prose(paragraph)))),
    drawnAlone("The charts and tables of this section", () => one.items.map(itemAlone)),
  );
}

function itemAlone(one) {
  return drawnAlone(one?.title ?? "A part of this section", () => item(one));
}

function item(one) {
  if (one.kind === "table") return h("figure", { class: "table" }, sortable(one));
  if (one.kind === "picture") return picture(one);
  if (one.kind === "file") return file(one);
  if (!Object.hasOwn(CHARTS, one.kind)) throw new Error(`a chart of the kind ${one.kind} is unknown`);
  const chart = CHARTS[one.kind](one);
  return h(
    "figure",
    { class: `chart ${one.kind}`, role: "group", "aria-label": one.title },
    h("figcaption", {}, prose(one.title)),
    chart.element,
    data(one.title, chart.table),
  );
}

/** The data of a chart as a table, made when it is opened. */
function data(title, table) {
  const details = h("details", { class: "data" }, h("summary", {}, "Data as a table"));
  details.addEventListener("toggle", () => {
    if (details.open && details.children.length === 1) {
      details.append(drawnAlone("The table", () => sortable({ title, ...table() })));
    }
  });
  return details;
}

function file(one) {
  const link = { href: `data:application/octet-stream;base64,${one.data}`, download: one.name };
  return h("p", {}, h("a", link, `Save ${one.name}`), `: ${one.title}`);
}

function picture(one) {
  return h(
    "figure",
    { class: "chart picture" },
    h("figcaption", {}, one.title),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": one.title }, h("img", { src: `data:${one.media_type};base64,${one.data}`, alt: one.title })),
  );
}
