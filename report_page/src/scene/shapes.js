// Meshes of a robot's shapes, as children of one group for each body.
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CapsuleGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  Object3D,
  SphereGeometry,
} from "three";
import { indices, numbers } from "./decode.js";

const GEOMETRIES = {
  sphere: ([radius]) => new SphereGeometry(radius, 24, 16),
  ellipsoid: ([x, y, z]) => new SphereGeometry(1, 24, 16).scale(x, y, z),
  box: ([x, y, z]) => new BoxGeometry(2 * x, 2 * y, 2 * z),
  // Three.js has their axis along y, MuJoCo along z.
  capsule: ([radius, half]) => new CapsuleGeometry(radius, 2 * half, 8, 20).rotateX(Math.PI / 2),
  cylinder: ([radius, half]) => new CylinderGeometry(radius, radius, 2 * half, 24).rotateX(Math.PI / 2),
};

function meshGeometry(mesh) {
  const indexed = new BufferGeometry();
  indexed.setAttribute("position", new BufferAttribute(numbers(mesh.vertices), 3));
  indexed.setIndex(new BufferAttribute(indices(mesh.faces), 1));
  const flat = indexed.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

/** The geometry of each shape; motions share them. */
export function geometries(scene) {
  const meshes = scene.meshes.map(meshGeometry);
  return scene.shapes.map((shape) =>
    shape.type === "mesh" ? meshes[shape.mesh] : GEOMETRIES[shape.type](shape.size),
  );
}

/** A robot: one group for each body. materialOf(body) returns the material of its shapes. */
export function robot(scene, shared, materialOf) {
  const bodies = scene.bodies.map(() => new Object3D()); // a Group would have an order of drawing of its own
  scene.shapes.forEach((shape, i) => {
    const mesh = new Mesh(shared[i], materialOf(shape.body));
    const [w, x, y, z] = shape.quaternion;
    mesh.position.fromArray(shape.position);
    mesh.quaternion.set(x, y, z, w);
    bodies[shape.body].add(mesh);
  });
  const whole = new Group();
  whole.add(...bodies);
  return { whole, bodies };
}

/** Puts every body where it is in a frame. */
export function pose({ bodies }, motion, frame) {
  const count = bodies.length;
  bodies.forEach((body, i) => {
    const at = frame * count + i;
    body.position.fromArray(motion.position, 3 * at);
    const [w, x, y, z] = motion.rotation.subarray(4 * at, 4 * at + 4);
    body.quaternion.set(x, y, z, w).normalize();
  });
}
