/** Which of the dropped files belong together, and what a raw file's name says about its layout. */

import type { Endian, VoxelType } from "../generated/proto";

/** What grouping needs to know of a file. */
export interface Named {
  name: string;
  size: number;
}

/** Files that are uploaded together as one dataset. */
export interface Group<F extends Named> {
  /** For people: the header's name, or the only file's. */
  name: string;
  files: F[];
  /** A raw file without a header or sidecar: its layout has to be asked for. */
  needsLayout: boolean;
  /** Pictures whose names differ in their numbers only. */
  slices: boolean;
}

/** Layout of a raw file, as its sidecar states it. */
export interface RawLayout {
  dims: [number, number, number];
  type: VoxelType;
  endian: Endian;
  header_bytes: number;
  /** Edges of a voxel. */
  spacing: [number, number, number];
}

const HEADER_EXTENSIONS = ["nhdr", "mhd", "hdr", "json"];
const RAW_EXTENSIONS = ["raw", "bin", "dat", "vol"];
const SERIES_EXTENSIONS = ["dcm", "dicom", "ima"];
/** Pictures that may be slices of one volume. */
const PICTURE_EXTENSIONS = ["tif", "tiff", "png"];
/** Scanners also name slices `IM0001` or `1.2.840.113619.2`. */
const SLICE_NAME = /^[^.]+$|^[\d.]+$|^I\d+\.\d+$/i;
/** Extensions that stand behind another one. */
const PACKED = /\.(gz|zst|bz2|xz|zip)$/i;

export const voxelBytes: Record<VoxelType, number> = {
  uint8: 1, int8: 1, uint16: 2, int16: 2, uint32: 4, int32: 4, uint64: 8, int64: 8, float32: 4, float64: 8,
};

const extensionOf = (name: string): string => /\.([^.]+)$/.exec(name.replace(PACKED, ""))?.[1]?.toLowerCase() ?? "";
const stemOf = (name: string): string => name.replace(PACKED, "").replace(/\.[^.]+$/, "").toLowerCase();

/** The name of the sidecar that states a raw file's layout: found for packed files, too. */
export const sidecarName = (rawName: string): string => `${rawName}.json`;

/** What the names of slices have in common: everything but their numbers. Null for other files. */
function slicesOf(name: string): string | null {
  const extension = extensionOf(name);
  if (!PICTURE_EXTENSIONS.includes(extension)) return null;
  const kind = extension === "tiff" ? "tif" : extension;
  return `${name.toLowerCase().replace(/\.[^.]+$/, "").replace(/\d+/g, "#")}.${kind}`;
}

/** Sets of at least two pictures whose names differ in their numbers only. */
function slicesAmong<F extends Named>(files: readonly F[]): F[][] {
  const sets = new Map<string, F[]>();
  for (const file of files) {
    const common = slicesOf(file.name);
    if (common !== null) sets.set(common, [...(sets.get(common) ?? []), file]);
  }
  return [...sets.values()].filter((set) => set.length > 1);
}

/** One group for each header with its data, one for a series, one for each set of slices, one for each other file. */
export function groupFiles<F extends Named>(files: readonly F[]): Group<F>[] {
  const isHeader = (file: F) => HEADER_EXTENSIONS.includes(extensionOf(file.name));
  const headers = files.filter(isHeader);
  const slices = files.filter((file) => SERIES_EXTENSIONS.includes(extensionOf(file.name)) || SLICE_NAME.test(file.name));
  // A single file without an extension may be anything; a series has several.
  const series = slices.length > 1 ? slices : slices.filter((file) => SERIES_EXTENSIONS.includes(extensionOf(file.name)));
  const rest = files.filter((file) => !isHeader(file) && !series.includes(file));
  const taken = new Set<F>();
  const groups: Group<F>[] = headers.map((header) => {
    const sameStem = rest.filter((file) => stemOf(file.name) === stemOf(header.name) || header.name === sidecarName(file.name));
    // A single header describes the other file even where their names differ.
    const data = sameStem.length > 0 || headers.length > 1 || rest.length > 1 ? sameStem : rest;
    data.forEach((file) => taken.add(file));
    return { name: header.name, files: [header, ...data], needsLayout: false, slices: false };
  });
  if (series[0]) groups.push({ name: series[0].name, files: series, needsLayout: false, slices: false });
  for (const set of slicesAmong(rest.filter((file) => !taken.has(file)))) {
    set.forEach((file) => taken.add(file));
    groups.push({ name: set[0]?.name ?? "", files: set, needsLayout: false, slices: true });
  }
  for (const file of rest.filter((other) => !taken.has(other))) {
    groups.push({ name: file.name, files: [file], needsLayout: RAW_EXTENSIONS.includes(extensionOf(file.name)), slices: false });
  }
  return groups;
}

/** Names that differ: slices in several folders often have the same. */
export function distinctNames(names: readonly string[]): string[] {
  const taken = new Set<string>();
  return names.map((name) => {
    let distinct = name;
    for (let count = 2; taken.has(distinct); count += 1) distinct = `${count}-${name}`;
    taken.add(distinct);
    return distinct;
  });
}

const typeWords: readonly [RegExp, VoxelType][] = [
  [/uint8|uchar|u8/i, "uint8"], [/uint16|ushort|u16/i, "uint16"], [/uint32|u32/i, "uint32"], [/uint64|u64/i, "uint64"],
  [/int8|i8/i, "int8"], [/int16|short|i16/i, "int16"], [/int32|i32/i, "int32"], [/int64|i64/i, "int64"],
  [/float64|double|f64/i, "float64"], [/float|f32/i, "float32"],
];

/** What name and size of a raw file suggest, for example `bonsai_256x256x256_uint8.raw`. */
export function guessLayout({ name, size }: Named): RawLayout {
  const sizes = /(\d{1,4})[x_](\d{1,4})[x_](\d{1,4})/i.exec(name);
  const cube = Math.round(Math.cbrt(size));
  const dims: [number, number, number] = sizes
    ? [Number(sizes[1]), Number(sizes[2]), Number(sizes[3])]
    : cube ** 3 === size ? [cube, cube, cube] : [1, 1, 1];
  const perVoxel = size / (dims[0] * dims[1] * dims[2]);
  const bySize: Record<number, VoxelType> = { 1: "uint8", 2: "uint16", 4: "float32", 8: "float64" };
  const type = typeWords.find(([word]) => word.test(name))?.[1] ?? bySize[perVoxel] ?? "uint8";
  return { dims, type, endian: "little", header_bytes: 0, spacing: [1, 1, 1] };
}

export const isPacked = (name: string): boolean => PACKED.test(name);

/** Why a layout does not fit a file of `size` bytes; null if it does. */
export function layoutProblem(layout: RawLayout, size: number, packed: boolean): string | null {
  if (layout.dims.some((voxels) => !Number.isInteger(voxels) || voxels < 1)) return "The size must be whole numbers of at least 1.";
  if (layout.spacing.some((edge) => !(edge > 0))) return "The spacing must be greater than 0.";
  if (!Number.isInteger(layout.header_bytes) || layout.header_bytes < 0) return "The header must be a whole number of bytes.";
  const needed = layout.header_bytes + layout.dims[0] * layout.dims[1] * layout.dims[2] * voxelBytes[layout.type];
  if (packed || needed === size) return null;
  const words = (bytes: number) => bytes.toLocaleString("en");
  return needed > size
    ? `This layout needs ${words(needed)} bytes; the file has only ${words(size)}.`
    : `This layout leaves ${words(size - needed)} bytes of the file unused.`;
}
