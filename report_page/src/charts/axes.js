// Axes of a chart over a horizontal axis: scales, ticks, labels and marks.
import { svg } from "../dom.js";
import { text, ticks } from "../numbers.js";

export function scale([low, high], from, to) {
  return (value) => from + ((value - low) / (high - low)) * (to - from);
}

/** The label of the axis is text below the chart, which wraps on a narrow page. */
export function horizontalAxis(x, [low, high], frame, whole = false) {
  const wanted = Math.max(2, Math.round((frame.right - frame.left) / 90));
  return [
    ...ticks(low, high, wanted).filter((value) => !whole || Number.isInteger(value)).map((value) => [
      svg("line", { class: "tick", x1: x(value), x2: x(value), y1: frame.bottom, y2: frame.bottom + 4 }),
      svg("text", { x: x(value), y: frame.bottom + 17, "text-anchor": "middle" }, text(value)),
    ]),
    svg("line", { class: "axis", x1: frame.left, x2: frame.right, y1: frame.bottom, y2: frame.bottom }),
  ];
}

export function verticalAxis(y, [low, high], frame, label) {
  return [
    ...ticks(low, high, 5).map((value) => [
      svg("line", { class: "grid", x1: frame.left, x2: frame.right, y1: y(value), y2: y(value) }),
      svg("text", { x: frame.left - 6, y: y(value) + 4, "text-anchor": "end" }, text(value)),
    ]),
    svg("text", { class: "label", x: 2, y: 11 }, label),
  ];
}

/** Vertical lines at the marks, with their intervals, and labels at that height where they fit. */
export function marks(list, x, frame, labels) {
  let end = -Infinity;
  return list.map((mark) => {
    const at = x(mark.value);
    const interval = mark.low === null ? [] : [
      svg("rect", { class: "mark-interval", x: x(mark.low), y: frame.top, width: Math.max(1, x(mark.high) - x(mark.low)), height: frame.bottom - frame.top }),
    ];
    const isChange = mark.low !== null;
    const fits = isChange || at > end;
    if (fits && !isChange) end = at + mark.label.length * 6.5 + 8;
    return [
      ...interval,
      svg("line", { class: isChange ? "mark change" : "mark", x1: at, x2: at, y1: frame.top, y2: frame.bottom }),
      fits ? svg("text", { class: isChange ? "mark change" : "mark", x: at + 4, y: isChange ? frame.top + 14 : labels }, mark.label) : null,
    ];
  });
}
