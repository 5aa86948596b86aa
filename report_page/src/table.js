// A table that the reader can sort by the heading of a column.
import { h, prose } from "./dom.js";
import { allDigits, text } from "./numbers.js";

/** Rows that are shown at first: a browser takes seconds for thousands. */
const FIRST_ROWS = 500;

/** Rows that are printed: a campaign has thousands, which nobody reads on paper. */
const PRINTED_ROWS = 60;

/** Columns from which a table is printed in small letters, so that none is cut off. */
const MANY_COLUMNS = 10;

export function sortable({ title, columns, rows }) {
  const numeric = columns.map((_, i) =>
    rows.every((row) => row[i] === null || typeof row[i] === "number"),
  );
  let shown = FIRST_ROWS;
  let current = rows;
  const body = h("tbody");
  const more = h("button", { type: "button", hidden: rows.length <= shown, onclick: showAll }, `Show all ${rows.length} rows`);
  const heads = columns.map((name, i) =>
    h(
      "th",
      { scope: "col", "aria-sort": "none", class: numeric[i] ? "number" : undefined },
      h("button", { type: "button", onclick: () => sort(i) }, name),
    ),
  );
  let order = 0;

  function sort(column) {
    order = heads[column].getAttribute("aria-sort") === "ascending" ? -1 : 1;
    heads.forEach((head) => head.setAttribute("aria-sort", "none"));
    heads[column].setAttribute("aria-sort", order > 0 ? "ascending" : "descending");
    current = [...rows].sort((a, b) => compared(a[column], b[column], order));
    fill();
  }

  function fill() {
    const lines = document.createDocumentFragment(); // a call takes some 100,000 arguments at most
    current.slice(0, shown).forEach((row, i) => lines.append(line(row, numeric, i >= PRINTED_ROWS)));
    body.replaceChildren(lines);
  }

  function showAll() {
    shown = Infinity;
    more.hidden = true;
    fill();
  }

  fill();

  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": title },
    h("table", { class: columns.length >= MANY_COLUMNS ? "wide" : undefined }, h("caption", {}, title), h("thead", {}, h("tr", {}, heads)), body),
    more,
    rows.length > PRINTED_ROWS ? h("p", { class: "note printed" }, `${PRINTED_ROWS} of ${rows.length} rows are printed; the file of this report has all.`) : null,
  );
}

function line(row, numeric, unprinted) {
  return h(
    "tr",
    { class: unprinted ? "unprinted" : undefined },
    row.map((value, i) =>
      h(
        i === 0 ? "th" : "td",
        {
          scope: i === 0 ? "row" : undefined,
          class: numeric[i] ? "number" : String(value ?? "").length > 16 ? "long" : undefined,
          "data-value": typeof value === "number" ? value : undefined,
          title: allDigits(value),
        },
        prose(text(value)),
      ),
    ),
  );
}

/** Unknown values are last in both directions. */
function compared(a, b, order) {
  if (a === null || b === null) return (a === null) - (b === null);
  if (typeof a === "number" && typeof b === "number") return order * (a - b);
  return order * String(a).localeCompare(String(b), undefined, { numeric: true });
}
