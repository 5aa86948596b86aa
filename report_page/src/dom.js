// Elements from names, attributes and children; texts are never read as HTML.
const SVG = "http://www.w3.org/2000/svg";

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(element.style, value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.flat(3).filter((child) => child !== null && child !== undefined));
  return element;
}

export function h(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** Text that may be broken after the signs of a notation, and has code in backticks. */
export function prose(text) {
  return String(text).split("`").map((part, i) => (i % 2 ? h("code", {}, part) : breakable(part)));
}

function breakable(text) {
  return text.split(/(?<=[+:_=])(?=\S)/).flatMap((part, i) => (i ? [h("wbr"), part] : [part]));
}

export function svg(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

/** Calls draw(width) into an element now and whenever its width changes. */
export function drawnToFit(element, draw) {
  let width = 0;
  const update = (wanted) => {
    const next = Math.max(240, Math.round(wanted));
    if (next === width) return;
    width = next;
    element.replaceChildren(draw(width));
  };
  new ResizeObserver(([entry]) => update(entry.contentRect.width)).observe(element);
  update(640);
  return element;
}
