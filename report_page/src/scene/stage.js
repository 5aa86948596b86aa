// The picture of the robots: WebGL, light, ground and camera.
import {
  Color,
  DirectionalLight,
  GridHelper,
  HemisphereLight,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { geometries, pose, robot } from "./shapes.js";

const GRID_CELLS = 80;
const VIEWS = { side: [0.3, -1, 0.35], front: [1, -0.25, 0.35], above: [0.02, -0.15, 1] };

/** A stage on a canvas; throws where there is no WebGL. */
export function stage(canvas, data) {
  const renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  const scene = new Scene();
  const camera = new PerspectiveCamera(35, 1, 0.01, 500);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  const shared = geometries(data);
  const size = Math.max(0.2, reach(data));
  const sky = new HemisphereLight(0xffffff, 0x777777, 2.2);
  const sun = new DirectionalLight(0xffffff, 2);
  sun.position.set(-1, -2, 4);
  scene.add(sky, sun);
  let grid = null;
  let robots = [];
  let shot = null;
  let frame = 0;
  let place = "travelled";

  function colour(name) {
    return new Color(getComputedStyle(document.body).getPropertyValue(name).trim());
  }

  function decorate() {
    scene.background = colour("--stage");
    if (grid) scene.remove(grid);
    const cell = size > 1 ? 1 : size > 0.1 ? 0.25 : 0.05;
    grid = new GridHelper(GRID_CELLS * cell, GRID_CELLS, colour("--grid"), colour("--grid"));
    grid.rotateX(Math.PI / 2);
    grid.userData.cell = cell;
    scene.add(grid);
    if (shot) load(shot, robots.map((one) => one.whole.visible));
  }

  function materials(motion, i) {
    const clear = i > 0;
    const common = { roughness: 0.75, transparent: true };
    const whole = new MeshStandardMaterial({ ...common, color: colour(`--motion${i}`), opacity: clear ? 0.55 : 1, depthWrite: !clear });
    const detached = new MeshStandardMaterial({ ...common, color: colour(`--motion${i}`), opacity: 0.18, depthWrite: false });
    const jammed = new MeshStandardMaterial({ ...common, color: colour("--bad"), opacity: clear ? 0.5 : 1, depthWrite: !clear });
    return (body) => {
      if (motion.detached.includes(body)) return detached;
      return motion.jammed.includes(body) ? jammed : whole;
    };
  }

  function load(next, visible) {
    shot = next;
    robots.forEach((one) => scene.remove(one.whole));
    robots = shot.motions.map((motion, i) => robot(data, shared, materials(motion, i)));
    robots.forEach((one, i) => {
      one.whole.visible = visible[i] ?? true;
      // The measured robot is drawn last, so that a motion shows beside it and does not tint it.
      one.whole.renderOrder = robots.length - i;
      scene.add(one.whole);
    });
  }

  function show(next) {
    frame = next;
    robots.forEach((one, i) => {
      pose(one, shot.motions[i], frame);
      one.whole.position.copy(shift(i));
    });
    const root = robots[0].bodies[data.root].position;
    follow();
    const { cell } = grid.userData;
    grid.position.set(Math.round(root.x / cell) * cell, Math.round(root.y / cell) * cell, 0);
    draw();
  }

  /** Where a robot is drawn, relative to where it is. */
  function shift(i) {
    const [first, own] = [robots[0], robots[i]].map((one) => one.bodies[data.root].position);
    if (place === "one") return new Vector3(first.x - own.x, first.y - own.y, 0);
    return new Vector3(0, place === "beside" ? 1.5 * size * i : 0, 0);
  }

  /** Turns the camera to the middle of the robots, and moves it back where it is too near. */
  function follow() {
    const roots = robots.filter((one) => one.whole.visible).map((one) => one.bodies[data.root].position.clone().add(one.whole.position));
    if (!roots.length) return;
    const focus = roots.reduce((sum, root) => sum.add(root), new Vector3()).divideScalar(roots.length);
    const spread = Math.max(...roots.map((root) => root.distanceTo(focus)));
    focus.z *= 0.8;
    const away = camera.position.clone().sub(controls.target);
    away.setLength(Math.max(away.length(), size * 3.2 + spread * 2.6));
    controls.target.copy(focus);
    camera.position.copy(focus).add(away);
  }

  function draw() {
    controls.update();
    renderer.render(scene, camera);
  }

  function look(name) {
    const away = new Vector3(...VIEWS[name]).normalize().multiplyScalar(size * 3.6);
    camera.position.copy(controls.target).add(away);
    follow();
    draw();
  }

  function resize() {
    const { clientWidth, clientHeight } = canvas;
    if (!clientWidth) return;
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / clientHeight;
    camera.updateProjectionMatrix();
    draw();
  }

  controls.enablePan = false;
  controls.enableZoom = true;
  controls.addEventListener("change", () => renderer.render(scene, camera));
  decorate();
  return { decorate, load, look, resize, show, put: (where) => { place = where; show(frame); look(where === "beside" ? "front" : "side"); }, visible: (i, on) => { robots[i].whole.visible = on; draw(); }, views: Object.keys(VIEWS) };
}

/** Size of the robot: the largest distance of a shape from the root in the first frame, m. */
function reach(data) {
  const [motion] = data.decoded[0].motions;
  const at = (body) => motion.position.subarray(3 * body, 3 * body + 3);
  const root = at(data.root);
  return data.shapes.reduce((far, shape) => {
    const [x, y, z] = at(shape.body);
    const size = shape.type === "mesh" ? Math.max(...data.meshes[shape.mesh].vertices.span) / 2 : Math.max(...shape.size);
    return Math.max(far, Math.hypot(x - root[0], y - root[1], z - root[2]) + size);
  }, 0);
}
