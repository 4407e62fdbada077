/** Volume files written in code, and the real scan that the service carries. */

import { readFile } from "node:fs/promises";

const NIFTI_HEADER_BYTES = 352;
const NIFTI_UINT8 = 2;
const NIFTI_MILLIMETRES = 2;

/** A CT scan; its origin and licence are in the README beside it. */
export const realScan = () => readFile(new URL("../../../server/service/samples/stent.nrrd", import.meta.url));

const EDGE = 40;
/** Values of the letter's parts. */
const BODY = 100;
const KNOB = 250;

/**
 * An uncompressed NIfTI of 40^3 bytes, 1 mm, whose axes run to the patient's right, to the front
 * and to the head. `valueAt(x, y, z)` is the voxel's value, 0..255.
 */
function nifti(valueAt) {
  const header = Buffer.alloc(NIFTI_HEADER_BYTES);
  header.writeInt32LE(348, 0);
  [3, EDGE, EDGE, EDGE, 1, 1, 1, 1].forEach((n, i) => header.writeInt16LE(n, 40 + 2 * i));
  header.writeInt16LE(NIFTI_UINT8, 70);
  header.writeInt16LE(8, 72);
  [1, 1, 1, 1].forEach((length, i) => header.writeFloatLE(length, 76 + 4 * i));
  header.writeFloatLE(NIFTI_HEADER_BYTES, 108);
  header.writeFloatLE(1, 112);
  header.writeUInt8(NIFTI_MILLIMETRES, 123);
  // The affine map: file axes are the world's right, front and head.
  header.writeInt16LE(1, 254);
  [[1, 0, 0, -20], [0, 1, 0, -20], [0, 0, 1, -20]].flat().forEach((m, i) => header.writeFloatLE(m, 280 + 4 * i));
  header.write("n+1\0", 344, "latin1");
  const voxels = Buffer.alloc(EDGE ** 3);
  for (let z = 0; z < EDGE; z += 1) for (let y = 0; y < EDGE; y += 1) for (let x = 0; x < EDGE; x += 1) voxels[(z * EDGE + y) * EDGE + x] = valueAt(x, y, z);
  return Buffer.concat([header, voxels]);
}

/**
 * An L of value 100 in empty space: a long low foot, and a tower at the patient's *left* end of it.
 * A knob of value 250 sticks out of the foot's middle to the front.
 */
export function letterL() {
  const inside = (...bounds) => (...place) => bounds.every(([low, high], axis) => place[axis] >= low && place[axis] < high);
  const foot = inside([5, 35], [15, 25], [6, 15]);
  const tower = inside([5, 14], [15, 25], [15, 34]);
  const knob = inside([17, 23], [25, 35], [7, 13]);
  return nifti((...place) => (knob(...place) ? KNOB : foot(...place) || tower(...place) ? BODY : 0));
}

/** A ball in the middle, its values rising over eight voxels from 0 outside to 250 inside. */
export function ball() {
  const middle = (EDGE - 1) / 2;
  return nifti((x, y, z) => {
    const radius = Math.hypot(x - middle, y - middle, z - middle);
    return Math.round(250 * Math.min(1, Math.max(0, (17 - radius) / 8)));
  });
}

/** An NRRD whose header promises 4096 bytes of voxels and which ends after 1000. */
export const truncatedNrrd = () => Buffer.concat([
  Buffer.from("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: raw\n\n", "latin1"), Buffer.alloc(1000, 7),
]);

/** 8.4 MB that take a while on a slow link: waves in 128 x 128 x 256 voxels of 16 bits. */
export function largeNrrd() {
  const [width, height, depth] = [128, 128, 256];
  const voxels = Buffer.alloc(width * height * depth * 2);
  for (let index = 0; index < voxels.length / 2; index += 1) voxels.writeUInt16LE((index * 7919) % 4096, 2 * index);
  const header = `NRRD0004\ntype: uint16\nendian: little\ndimension: 3\nsizes: ${width} ${height} ${depth}\nencoding: raw\n\n`;
  return Buffer.concat([Buffer.from(header, "latin1"), voxels]);
}
