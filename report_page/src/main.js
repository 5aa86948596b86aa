// Draws the report whose JSON is in the page. A part that fails is a sentence, and the others follow.
import { h, prose } from "./dom.js";
import { drawnAlone } from "./failure.js";
import { player } from "./scene/player.js";
import { section } from "./section.js";

function whole(report) {
  const parts = document.createDocumentFragment();
  parts.append(
    drawnAlone("The beginning of the report", () => header(report)),
    drawnAlone("The list of sections", () => contents(report)),
  );
  if (report.scene) parts.append(motion(report.scene));
  parts.append(
    ...report.sections.map((one) => drawnAlone(`The section ${one?.title}`, () => section(one))),
    drawnAlone("The end of the report", () => footer(report)),
  );
  return parts;
}

function header(report) {
  return h(
    "header",
    {},
    h("p", { class: "title" }, report.title),
    h("h1", {}, prose(report.headline)),
    report.verdict.map((sentence) => h("p", {}, prose(sentence))),
  );
}

function contents(report) {
  const links = report.sections.map((one) =>
    h("li", {}, h("a", { href: `#${one.key}` }, one.title)),
  );
  if (report.scene) links.unshift(h("li", {}, h("a", { href: "#motion" }, "Motion")));
  return h("nav", { "aria-label": "Sections" }, h("ul", {}, links));
}

/** The robots; their heading stays where they fail, as the list of sections refers to it. */
function motion(scene) {
  return h(
    "section",
    { id: "motion", "aria-labelledby": "motion-heading" },
    h("h2", { id: "motion-heading" }, "Motion"),
    drawnAlone("The motion of the robots", () => player(scene)),
  );
}

function footer(report) {
  const versions = Object.entries(report.made_with).map(([name, version]) => `${name} ${version}`);
  const made = versions.length ? `Trials made with ${versions.join(", ")}. ` : "";
  return h("footer", {}, h("p", {}, `${made}Numbers are those of the logs and results.`));
}

const read = () => whole(JSON.parse(document.getElementById("report").textContent));
document.getElementById("main").replaceChildren(drawnAlone("The report", read));
document.body.dataset.ready = "yes";
