// A page that is served while a recovery runs: what happens now, and the next page when there is one.
import { h } from "./dom.js";

const PERIOD = 2000;

/** Follows the server of the page, if it has one. */
export function follow() {
  const version = Number(document.body.dataset.version);
  if (!location.protocol.startsWith("http") || !version) return;
  const line = h("p", { class: "live", role: "status" });
  document.body.append(line);

  async function ask() {
    let status;
    try {
      status = await (await fetch("status.json")).json();
    } catch {
      line.textContent = "The recovery has ended, or was interrupted.";
      return;
    }
    line.textContent = status.line;
    if (status.version !== version) location.reload();
    else if (status.running) setTimeout(ask, PERIOD);
  }

  ask();
}
