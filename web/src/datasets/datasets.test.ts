import { describe, expect, it } from "vitest";
import { formatBytes } from "./format";
import { distinctNames, groupFiles, guessLayout, layoutProblem, sidecarName } from "./grouping";
import { boundaryOf, fingerprint, formOf, formType, inOrder, mayPass, randomBoundary, timeLeft } from "./resumable";
import { hasSeveralPages, stacksApart } from "./stacks";
import { Turns } from "./turns";
import { endOf, SpeedMeter } from "./upload";

const named = (...names: string[]) => names.map((name) => ({ name, size: 10 }));
const groups = (...names: string[]) => groupFiles(named(...names)).map((group) => group.files.map((file) => file.name));

describe("dropped files", () => {
  it("go together when there is a header and its data", () => {
    expect(groups("engine.raw.gz", "engine.nhdr")).toEqual([["engine.nhdr", "engine.raw.gz"]]);
    expect(groups("head.mhd", "voxels.raw")).toEqual([["head.mhd", "voxels.raw"]]);
    expect(groups("fuel.json", "fuel.raw")).toEqual([["fuel.json", "fuel.raw"]]);
  });

  it("are told apart by their names", () => {
    expect(groups("a.nhdr", "b.raw", "a.raw", "c.nrrd")).toEqual([["a.nhdr", "a.raw"], ["b.raw"], ["c.nrrd"]]);
    expect(groups("a.nhdr", "b.nhdr", "b.raw")).toEqual([["a.nhdr"], ["b.nhdr", "b.raw"]]);
  });

  it("are one dataset when they are a series", () => {
    expect(groups("1.dcm", "2.dcm", "x.nii.gz")).toEqual([["1.dcm", "2.dcm"], ["x.nii.gz"]]);
  });

  it("are a series without extensions, too", () => {
    expect(groups("IM0001", "IM0002", "1.2.840.1", "a.nrrd")).toEqual([["IM0001", "IM0002", "1.2.840.1"], ["a.nrrd"]]);
    expect(groups("scan.zip")).toEqual([["scan.zip"]]);
  });

  it("are one dataset when they are slices that count", () => {
    expect(groups("s_1.tif", "s_2.TIF", "s_10.tiff")).toEqual([["s_1.tif", "s_2.TIF", "s_10.tiff"]]);
    expect(groups("a001.png", "a002.png", "b001.png", "b002.png")).toEqual([["a001.png", "a002.png"], ["b001.png", "b002.png"]]);
    expect(groups("1.png", "2.png", "x.nrrd")).toEqual([["1.png", "2.png"], ["x.nrrd"]]);
    expect(groups("stack.tif", "other.tif", "a1.png", "a1.tif")).toEqual([["stack.tif"], ["other.tif"], ["a1.png"], ["a1.tif"]]);
  });

  it("get distinct names", () => {
    expect(distinctNames(["a", "a", "b", "a"])).toEqual(["a", "2-a", "b", "3-a"]);
  });

  it("need a layout only when raw and alone", () => {
    expect(groupFiles(named("a.raw"))[0]?.needsLayout).toBe(true);
    expect(groupFiles(named("a.raw.gz"))[0]?.needsLayout).toBe(true);
    expect(groupFiles(named("a.raw", "a.json"))[0]?.needsLayout).toBe(false);
    expect(groupFiles(named("a.nrrd"))[0]?.needsLayout).toBe(false);
  });
});

/** A TIFF's chain of directories, each with one entry; `big` with 64-bit places. */
function tiff(pages: number, little: boolean, big: boolean): File {
  const [head, directory] = big ? [16, 8 + 20 + 8] : [8, 2 + 12 + 4];
  const view = new DataView(new ArrayBuffer(head + pages * directory));
  const put = (at: number, value: number) => (big ? view.setBigUint64(at, BigInt(value), little) : view.setUint32(at, value, little));
  view.setUint16(0, little ? 0x4949 : 0x4d4d);
  view.setUint16(2, big ? 43 : 42, little);
  put(big ? 8 : 4, head);
  for (let page = 0; page < pages; page += 1) {
    const at = head + page * directory;
    if (big) view.setBigUint64(at, 1n, little);
    else view.setUint16(at, 1, little);
    put(at + (big ? 28 : 14), page + 1 < pages ? at + directory : 0);
  }
  return new File([view.buffer], `s${pages}.tif`);
}

describe("a TIFF's pages", () => {
  it.each([[true, false], [false, false], [true, true], [false, true]])("are seen (little %s, big %s)", async (little, big) => {
    expect(await hasSeveralPages(tiff(1, little, big))).toBe(false);
    expect(await hasSeveralPages(tiff(3, little, big))).toBe(true);
  });

  it("are none where a file is broken or none", async () => {
    expect(await hasSeveralPages(new Blob(["II"]))).toBe(false);
    expect(await hasSeveralPages(new Blob(["\x89PNG, which is no TIFF"]))).toBe(false);
    expect(await hasSeveralPages(tiff(3, true, false).slice(0, 12))).toBe(false);
  });

  it("part files that only look like slices", async () => {
    const apart = async (pages: number) => {
      const files = [1, 2].map((number) => new File([tiff(pages, true, false)], `a${number}.tif`));
      const all = await Promise.all(groupFiles(files).map(stacksApart));
      return all.flat().map((group) => group.files.map((file) => file.name));
    };
    expect(await apart(1)).toEqual([["a1.tif", "a2.tif"]]);
    expect(await apart(5)).toEqual([["a1.tif"], ["a2.tif"]]);
  });
});

describe("a raw file's layout", () => {
  it("is guessed from name and size", () => {
    expect(guessLayout({ name: "bonsai_256x128x64_uint16.raw", size: 1 })).toMatchObject({ dims: [256, 128, 64], type: "uint16" });
    expect(guessLayout({ name: "silicium_98_34_34_uint8.dat", size: 1 })).toMatchObject({ dims: [98, 34, 34], type: "uint8" });
    expect(guessLayout({ name: "a_4x4x4.raw", size: 256 }).type).toBe("float32");
    expect(guessLayout({ name: "cube.raw", size: 27 }).dims).toEqual([3, 3, 3]);
  });

  it("is checked against the file", () => {
    const layout = { dims: [4, 4, 4] as [number, number, number], type: "uint16" as const, endian: "little" as const, header_bytes: 10,
      spacing: [1, 1, 2] as [number, number, number] };
    expect(layoutProblem(layout, 138, false)).toBeNull();
    expect(layoutProblem(layout, 137, false)).toContain("only 137");
    expect(layoutProblem(layout, 140, false)).toContain("2 bytes of the file unused");
    expect(layoutProblem(layout, 1, true)).toBeNull();
    expect(layoutProblem({ ...layout, dims: [0, 1, 1] }, 138, true)).toContain("at least 1");
    expect(layoutProblem({ ...layout, spacing: [1, 0, 1] }, 138, true)).toContain("greater than 0");
  });

  it("is stated beside the file", () => {
    expect(sidecarName("fuel_64.raw.gz")).toBe("fuel_64.raw.gz.json");
    expect(groups("a.raw.json", "b.raw", "a.raw")).toEqual([["a.raw.json", "a.raw"], ["b.raw"]]);
  });
});

describe("numbers in words", () => {
  it("have fitting units", () => {
    expect(formatBytes(999)).toBe("999 B");
    expect(formatBytes(16_777_216)).toBe("16.8 MB");
  });

  it("measure speed over the last moments", () => {
    const meter = new SpeedMeter();
    expect(meter.mark(0, 0)).toBe(0);
    expect(meter.mark(1000, 1000)).toBeCloseTo(1000, 9);
    expect(meter.mark(9000, 5000)).toBe(0);
    expect(meter.mark(10_000, 6000)).toBeCloseTo(1000, 9);
  });
});

describe("turns", () => {
  it("are few at a time, in order, and leave out who no longer waits", () => {
    const turns = new Turns(2);
    const started: string[] = [];
    const [a, , c] = ["a", "b", "c", "d"].map((name) => turns.ask(() => started.push(name)));
    expect(started).toEqual(["a", "b"]);
    c?.();
    a?.();
    a?.();
    expect(started).toEqual(["a", "b", "d"]);
    turns.ask(() => started.push("e"));
    expect(started).not.toContain("e");
  });
});

describe("resumable uploads", () => {
  const file = (name: string, size: number, lastModified = 5) => ({ name, size, lastModified });

  it("know the same files again, however they are dropped", () => {
    const one = fingerprint([file("a.mhd", 3), file("a.raw", 40)]);
    expect(fingerprint([file("a.raw", 40), file("a.mhd", 3)])).toBe(one);
    expect(one).toMatch(/^tyndall-[0-9a-f]{16}-43$/);
    const others = [[file("a.mhd", 3)], [file("a.mhd", 3), file("b.raw", 40)], [file("a.mhd", 3, 6), file("a.raw", 40)], [file("a.mhd", 4), file("a.raw", 39)]];
    expect(new Set([one, ...others.map(fingerprint)]).size).toBe(5);
  });

  it("send several files as one form", async () => {
    const boundary = randomBoundary();
    expect(boundary).toMatch(/^[0-9a-f]{32}$/);
    const files = [new File(["voxels"], 'b"1.raw'), new File(["head"], "a.mhd"), new File(["other"], "a.mhd", { lastModified: 1 })];
    const body = formOf(files, boundary);
    const request = new Request("http://x/", { method: "POST", body, headers: { "content-type": formType(boundary) } });
    const parts = (await request.formData()).getAll("file") as File[];
    expect(await Promise.all(parts.map(async (part) => [part.name, await part.text()]))).toEqual([["a.mhd", "head"], ["2-a.mhd", "other"], ['b"1.raw', "voxels"]]);
    expect(await formOf([...files].reverse(), boundary).text()).toBe(await body.text());
    expect(inOrder(files).map(({ name }) => name)).toEqual(["a.mhd", "a.mhd", 'b"1.raw']);
  });

  it("keep a form's boundary", () => {
    expect(boundaryOf(formType("xy"))).toBe("xy");
    expect(boundaryOf("image/tiff")).toBeNull();
    expect(boundaryOf(undefined)).toBeNull();
  });

  it("try again what may pass, and nothing else", () => {
    expect([0, 423, 503].every(mayPass)).toBe(true);
    expect([400, 404, 410, 413, 422, 460, 500, 507].some(mayPass)).toBe(false);
  });

  it("end as the service says", () => {
    const upload = { length: 5, offset: 5 };
    const problem = { type: "about:blank", title: "Full", status: 507, detail: "The disk is full." };
    expect(endOf({ ...upload, state: "reading" })).toBeNull();
    expect(endOf({ ...upload, state: "receiving" })).toBeNull();
    expect(endOf({ ...upload, state: "refused", problem })).toEqual({ kind: "failed", message: "The disk is full.", kept: false });
    expect(endOf({ ...upload, state: "failed", problem })).toEqual({ kind: "failed", message: "The disk is full.", kept: true });
    expect(endOf({ ...upload, state: "stored" })).toMatchObject({ kind: "failed", kept: false });
  });

  it("say how long they will take", () => {
    expect(timeLeft(1000, 0)).toBe("");
    expect(timeLeft(1000, 300)).toBe("4 s left");
    expect(timeLeft(600_000, 1000)).toBe("10 min left");
    expect(timeLeft(9_000_000, 1000)).toBe("3 h left");
  });
});
