// What the reader sees where a part of the page cannot be drawn.
import { h } from "./dom.js";

/** Returns what draw() returns; if it fails, a sentence in its place, and the error on the console. */
export function drawnAlone(what, draw) {
  try {
    return draw();
  } catch (error) {
    console.error(`${what} could not be drawn:`, error);
    return h(
      "p",
      { class: "failure", role: "alert" },
      `${what} could not be drawn (${error}). The rest of the page does not depend on it; the console of the browser has the place of the error.`,
    );
  }
}
