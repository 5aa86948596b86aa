// Numbers as text, ticks of axes and ranges.

/** An integer, or a number with at most six significant digits; a dash where there is none. */
export function text(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value !== "number" || Number.isInteger(value)) return String(value);
  return String(Number(value.toPrecision(6)));
}

/** All digits of a number that `text` shortens; undefined for other values. */
export function allDigits(value) {
  return typeof value === "number" && text(value) !== String(value) ? String(value) : undefined;
}

/** A number with three significant digits, for labels. */
export function short(value) {
  return value === null || value === undefined ? "–" : String(Number(value.toPrecision(3)));
}

export function known(values) {
  return values.filter((value) => value !== null && value !== undefined);
}

/** Smallest and largest of the known values; a span of 0 is widened. */
export function range(values, include = []) {
  const all = [...known(values), ...include];
  if (all.length === 0) return [0, 1];
  let low = Infinity;
  let high = -Infinity;
  for (const value of all) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low === high ? [low - 0.5, high + 0.5] : [low, high];
}

/** Round numbers within a range, about as many as wanted. */
export function ticks(low, high, wanted) {
  const rough = (high - low) / Math.max(1, wanted);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((one) => one >= rough * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  // Between two neighbouring numbers there is no room for a tick, and counting to them never ends.
  if (!(Math.abs(first) < 1e12 && count > 0)) return [];
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}
