/** Pictures as numbers. A picture is `{ width, height, data }`, rows from the top, RGBA bytes. */

import { createHash } from "node:crypto";
import { PNG } from "pngjs";

export const pictureFromPng = (bytes) => {
  const { width, height, data } = PNG.sync.read(Buffer.from(bytes));
  return { width, height, data };
};

/** Rec. 709 luma of the encoded values, 0..255. */
const luma = (data, at) => 0.2126 * data[at] + 0.7152 * data[at + 1] + 0.0722 * data[at + 2];

/** Mean luma of the pixels that `where` takes, 0..255; all of them if it is left out. */
export function meanLuma({ width, height, data }, where = () => true) {
  let sum = 0;
  let count = 0;
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      if (!where(x, y)) continue;
      sum += luma(data, 4 * (y * width + x));
      count += 1;
    }
  }
  return sum / Math.max(1, count);
}

/**
 * Share and centre of the pixels whose colour `takes` accepts. The centre is in picture widths and
 * heights, from the left and from the top.
 */
export function region({ width, height, data }, takes) {
  let [count, sumX, sumY] = [0, 0, 0];
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      const at = 4 * (y * width + x);
      if (!takes(data[at], data[at + 1], data[at + 2])) continue;
      count += 1;
      sumX += x + 0.5;
      sumY += y + 0.5;
    }
  }
  return { share: count / (width * height), x: sumX / Math.max(1, count) / width, y: sumY / Math.max(1, count) / height };
}

/** The part of a picture between two places, in picture widths and heights. */
export function cut({ width, height, data }, [left, top], [right, bottom]) {
  const [x0, y0, x1, y1] = [left * width, top * height, right * width, bottom * height].map(Math.round);
  const rows = Array.from({ length: y1 - y0 }, (_, row) => data.subarray(4 * ((y0 + row) * width + x0), 4 * ((y0 + row) * width + x1)));
  return { width: x1 - x0, height: y1 - y0, data: Buffer.concat(rows) };
}

/** Brighter than the background of every scene here. */
export const isLit = (r, g, b) => Math.max(r, g, b) > 40;

/** How much two pictures of one size differ: mean and greatest difference of a channel, 0..255. */
export function difference(a, b) {
  if (a.width !== b.width || a.height !== b.height) throw new Error(`sizes differ: ${a.width}x${a.height}, ${b.width}x${b.height}`);
  let [sum, most] = [0, 0];
  for (let at = 0; at < a.data.length; at += 1) {
    if (at % 4 === 3) continue;
    const d = Math.abs(a.data[at] - b.data[at]);
    sum += d;
    most = Math.max(most, d);
  }
  return { mean: sum / (a.width * a.height * 3), most };
}

/** SHA-256 of a picture's size and colours. */
export function hashOf({ width, height, data }) {
  const colours = Buffer.from(data);
  for (let at = 3; at < colours.length; at += 4) colours[at] = 255;
  return createHash("sha256").update(`${width} ${height} `).update(colours).digest("hex");
}
