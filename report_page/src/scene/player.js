// The robots of a trial on one timeline: picture, slider, legend and the joint angles.
import { h, prose } from "../dom.js";
import { short } from "../numbers.js";
import { angle, decoded } from "./decode.js";
import { stage } from "./stage.js";

export function player(scene) {
  const data = { ...scene, decoded: scene.shots.map(decoded) };
  const canvas = h("canvas", { "aria-label": "The robots at the time of the slider; drag to turn the view", role: "img" });
  const picture = h("div", { class: "stage" }, canvas);
  const time = h("output", { for: "time" });
  const slider = h("input", { type: "range", id: "time", min: 0, step: 1, value: 0, "aria-label": "Time in the trial", oninput: () => seek(Number(slider.value)) });
  const play = h("button", { type: "button", onclick: toggle }, "Play");
  const choice = h("select", { id: "trial", onchange: () => load(choice.selectedIndex) }, scene.shots.map((shot) => h("option", {}, shot.name)));
  const legend = h("ul", { class: "legend motions", "aria-label": "Robots in the picture" });
  const place = h(
    "select",
    { id: "place", onchange: () => views.put(place.value) },
    h("option", { value: "travelled" }, "where they are"),
    h("option", { value: "beside" }, "side by side"),
    h("option", { value: "one" }, "at one place"),
  );
  const mark = h("div", { class: "slider-mark", hidden: true });
  const note = h("p", { class: "note", "aria-live": "polite" });
  const body = h("tbody");
  const head = h("tr");
  const angles = h(
    "details",
    { class: "data angles", ontoggle: () => fill() },
    h("summary", {}, "Joint angles at this time, as a table"),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Joint angles" }, h("table", {}, h("caption", {}, "Joint angles, rad, and travel of the base, m"), h("thead", {}, head), body)),
  );
  let shot = data.decoded[0];
  let frame = 0;
  let started = null;
  let views = null;

  try {
    views = stage(canvas, data);
  } catch (error) {
    console.error("The robots could not be drawn:", error);
    picture.replaceChildren(h("p", { class: "failure", role: "alert" }, `The robots are not drawn, ${reason(error)}; their joint angles are in the table below.`));
  }

  function load(index) {
    shot = data.decoded[index];
    choice.selectedIndex = index;
    slider.max = shot.time.length - 1;
    const visible = shot.motions.map(() => true);
    legend.replaceChildren(...shot.motions.map(entry));
    mark.hidden = shot.mark === null;
    if (shot.mark !== null) {
      mark.style.left = `${(shot.mark / shot.time.at(-1)) * 100}%`;
      mark.textContent = `change at ${short(shot.mark)} s`;
    }
    note.textContent = notes(shot);
    head.replaceChildren(h("th", { scope: "col" }, "joint"), ...shot.motions.map((motion) => h("th", { scope: "col", class: "number" }, motion.name)));
    views?.load(shot, visible);
    seek(0);
    views?.look("side");
  }

  function entry(motion, i) {
    const box = h("input", { type: "checkbox", checked: true, onchange: () => views?.visible(i, box.checked) });
    const name = i === 0 ? motion.name : `${motion.name}: ${motion.hypothesis}`;
    return h("li", {}, h("label", {}, box, h("span", { class: `swatch motion${i}`, "aria-hidden": "true" }), prose(name)));
  }

  /** Shows a frame that the reader chose; a motion that plays goes on from there. */
  function seek(next) {
    show(next);
    if (started !== null) started = performance.now() - shot.time[frame] * 1000;
  }

  function show(next) {
    frame = Math.min(next, shot.time.length - 1);
    slider.value = frame;
    const text = `${shot.time[frame].toFixed(2)} s`;
    slider.setAttribute("aria-valuetext", text);
    time.textContent = `${text} of ${shot.time.at(-1).toFixed(2)} s`;
    views?.show(frame);
    fill();
  }

  function fill() {
    if (!angles.open) return;
    const rows = scene.hinges.map((name, i) => [name, ...shot.motions.map((motion) => motion.angles[frame * scene.hinges.length + i])]);
    rows.push(["travel, m", ...shot.motions.map((motion) => motion.travelled[frame])]);
    body.replaceChildren(
      ...rows.map(([name, ...values]) => h("tr", {}, h("th", { scope: "row" }, name), values.map((value, i) => h("td", { class: "number", "data-value": value, "data-drawn": drawn(name, shot.motions[i]) }, value === null ? "–" : value.toFixed(4))))),
    );
  }

  /** The angle in the picture, from the rotations of the two bodies at a hinge. */
  function drawn(name, motion) {
    const hinge = scene.turned.find((one) => one.name === name);
    return hinge && angle(motion, scene.bodies.length, frame, hinge);
  }

  function toggle() {
    if (started === null && frame === shot.time.length - 1) show(0);
    started = started === null ? performance.now() - shot.time[frame] * 1000 : null;
    play.textContent = started === null ? "Play" : "Pause";
    if (started !== null) requestAnimationFrame(advance);
  }

  function advance(now) {
    if (started === null) return;
    const at = (now - started) / 1000;
    let next = frame;
    while (next + 1 < shot.time.length && shot.time[next + 1] <= at) next += 1;
    if (next !== frame) show(next);
    if (next === shot.time.length - 1) toggle();
    else requestAnimationFrame(advance);
  }

  const buttons = (views?.views ?? []).map((name) => h("button", { type: "button", onclick: () => views.look(name) }, name));
  load(initial(scene));
  if (views) {
    new ResizeObserver(() => views.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      views.decorate();
      show(frame);
    });
  }
  return h(
    "div",
    {},
    h("p", {}, "The measured robot, and the robot that each hypothesis predicts for the same controller from its initial pose, at the same time. A limb that a hypothesis detaches is pale, a part that it jams is red."),
    h("div", { class: "controls" }, h("label", { for: "trial" }, "Trial "), choice, h("span", { role: "group", "aria-label": "View" }, buttons), views ? h("label", {}, "Robots ", place) : null),
    picture,
    h("div", { class: "controls timeline" }, play, h("div", { class: "slider" }, slider, mark), time),
    legend,
    note,
    angles,
  );
}

/** Why there is no picture: a page without WebGL is not a page with damaged shapes. */
function reason(error) {
  return document.createElement("canvas").getContext("webgl2") ? `because of an error (${error})` : "because this browser has no WebGL 2";
}

/** The trial after the failure, or else the first. */
function initial(scene) {
  return Math.max(0, scene.shots.findIndex((shot) => shot.motions.some((motion) => motion.name === "best hypothesis")));
}

function notes(shot) {
  const [measured] = shot.motions;
  const found = [];
  if (measured.missing.length) found.push(`Never observed, and drawn as in the initial pose: ${measured.missing.join(", ")}.`);
  if (measured.held.length) found.push(`${measured.held.length} of ${shot.time.length} frames lack an observation and show the last one.`);
  if (shot.mark !== null) found.push("The robot changed in this trial; each hypothesis is simulated from its beginning.");
  if (shot.motions.length < 2) found.push("The simulation of every hypothesis diverged.");
  return found.join(" ");
}
