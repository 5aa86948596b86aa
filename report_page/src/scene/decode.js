// Arrays of the report's JSON, and the angle of a hinge from the rotations of two bodies.

const LEVELS = 65535;

export function bytes(base64) {
  const binary = atob(base64);
  const found = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i += 1) found[i] = binary.charCodeAt(i);
  return found;
}

/** Numbers of 16-bit levels between the bounds of each column. */
export function numbers({ low, span, data }) {
  const view = new DataView(bytes(data).buffer);
  const found = new Float32Array(view.byteLength / 2);
  for (let i = 0; i < found.length; i += 1) {
    const column = i % low.length;
    found[i] = low[column] + (span[column] * view.getUint16(2 * i, true)) / LEVELS;
  }
  return found;
}

export function indices(base64) {
  const view = new DataView(bytes(base64).buffer);
  return Uint32Array.from({ length: view.byteLength / 4 }, (_, i) => view.getUint32(4 * i, true));
}

/** A shot with its poses as numbers. */
export function decoded(shot) {
  const motions = shot.motions.map((motion) => ({
    ...motion,
    position: numbers(motion.position),
    rotation: numbers(motion.rotation),
    angles: numbers(motion.angles),
  }));
  return { ...shot, motions };
}

function product(a, b) {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

function inverse([w, x, y, z]) {
  return [w, -x, -y, -z];
}

/** Rotation of a body in a frame: a quaternion w x y z. */
export function rotation(motion, bodies, frame, body) {
  const at = 4 * (frame * bodies + body);
  return Array.from(motion.rotation.subarray(at, at + 4));
}

/** Angle of a hinge in a frame, rad, within half a turn of its reference. */
export function angle(motion, bodies, frame, hinge) {
  const parent = rotation(motion, bodies, frame, hinge.parent);
  const body = rotation(motion, bodies, frame, hinge.body);
  const turned = product(inverse(hinge.rest), product(inverse(parent), body));
  const along = turned[1] * hinge.axis[0] + turned[2] * hinge.axis[1] + turned[3] * hinge.axis[2];
  const half = Math.atan2(along, turned[0]);
  const full = 2 * half;
  return hinge.reference + Math.atan2(Math.sin(full), Math.cos(full));
}
