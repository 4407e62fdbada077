/** TIFF files of several pages: each is a volume by itself, whatever its name counts. */

import type { Group } from "./grouping";

/** Sizes of what a TIFF directory consists of, bytes: the number of its entries, an entry, the next directory's place. */
const CLASSIC = { count: 2, entry: 12, next: 4 };
const BIG = { count: 8, entry: 20, next: 8 };
const BIG_VERSION = 43;

/** Whether a file is a TIFF of more than one page. */
export async function hasSeveralPages(file: Blob): Promise<boolean> {
  const bytes = async (from: number, count: number) => new DataView(await file.slice(from, from + count).arrayBuffer());
  const head = await bytes(0, 16);
  if (head.byteLength < 8) return false;
  const order = head.getUint16(0);
  if (order !== 0x4949 && order !== 0x4d4d) return false;
  const little = order === 0x4949;
  const sizes = head.getUint16(2, little) === BIG_VERSION ? BIG : CLASSIC;
  // 0 where the file ends before: it is broken, and the service says so.
  const number = (view: DataView, at: number, size: number): number => {
    if (view.byteLength < at + size) return 0;
    if (size === 8) return Number(view.getBigUint64(at, little));
    return size === 4 ? view.getUint32(at, little) : view.getUint16(at, little);
  };
  const directory = number(head, sizes === BIG ? 8 : 4, sizes.next);
  const entries = number(await bytes(directory, sizes.count), 0, sizes.count);
  const next = await bytes(directory + sizes.count + entries * sizes.entry, sizes.next);
  return number(next, 0, sizes.next) !== 0;
}

/** A group as it is; slices that turn out to be stacks of their own, one by one. */
export async function stacksApart<F extends File>(group: Group<F>): Promise<Group<F>[]> {
  const [first] = group.files;
  // A file that cannot be read fails when it is sent, with words.
  if (!group.slices || !first || !(await hasSeveralPages(first).catch(() => false))) return [group];
  return group.files.map((file) => ({ name: file.name, files: [file], needsLayout: false, slices: false }));
}
