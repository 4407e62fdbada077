import { describe, expect, it } from "vitest";
import { MAX_OPACITY, type Histogram, type SceneFile, type TransferFunctionPoint, type VoxelType } from "../generated/proto";
import { costBins, costInWords, costRuns, sharesOf, stripInWords } from "./editCost";
import { regionOf } from "./inView";
import { ceilingAbove, extinctionFromOpacity, heightOf, inUnit, opacityAt, opacityFromExtinction, withOpacity } from "./opacity";
import { PictureCache, pictureKey } from "./pictures";
import { addPoint, changePoints, insertPoints, matterAt, movePoint, movePoints, opacityAtValue, removePoints, widestGap } from "./points";
import { looksLikeCt, otsuThreshold, presetsFor, quantile } from "./presets";
import { ontoRange } from "./reframe";
import { formatData, formatValue, histogramColumns, panWindow, positionOf, ticks, valueOf, wholeValues, zoomWindow, type Range } from "./valueAxis";

const point = (s: number, opacity: number, extra: Partial<TransferFunctionPoint> = {}): TransferFunctionPoint => ({
  s, opacity, albedo: [1, 1, 1], emission: [0, 0, 0], ...extra,
});
const linear = { axis: "linear", ceiling: 1 } as const;
const points = [point(0, 0), point(0.4, 0.2, { material: "bone" }), point(0.6, 0.8), point(1, 1)];

describe("opacity and extinction", () => {
  it("follow the contract: 0.5 over 0.01 world units", () => {
    expect(extinctionFromOpacity(0.5)).toBeCloseTo(69.3147, 4);
    expect(opacityFromExtinction(69.3147)).toBeCloseTo(0.5, 5);
  });

  it("clamp at the largest opacity", () => {
    expect(extinctionFromOpacity(1)).toBeCloseTo(extinctionFromOpacity(MAX_OPACITY), 9);
    expect(opacityFromExtinction(1e9)).toBe(MAX_OPACITY);
  });

  it("keep the unit a point was given in", () => {
    const dense = { s: 0, extinction: 5000, albedo: [1, 1, 1], emission: [0, 0, 0] } satisfies TransferFunctionPoint;
    expect(withOpacity(dense, 0.5)).toMatchObject({ extinction: 69.3147 });
    expect(withOpacity(dense, 0.5)).not.toHaveProperty("opacity");
    expect(movePoint([dense], 0, 0.3, null)[0]).toMatchObject({ s: 0.3, extinction: 5000 });
    expect(inUnit(dense, "opacity")).not.toHaveProperty("extinction");
  });

  it.each(["linear", "power"] as const)("invert on the %s axis", (axis) => {
    for (const opacity of [0, 0.001, 0.3, 1]) {
      for (const ceiling of [1, 0.02]) expect(opacityAt(heightOf(opacity, { axis, ceiling }), { axis, ceiling })).toBeCloseTo(opacity, 12);
    }
    expect(heightOf(0.02, { axis, ceiling: 0.02 })).toBeCloseTo(1, 12);
  });

  it("have a round upper end just above the curve", () => {
    expect([0, 0.004, 0.012, 0.3, 0.46, 0.95, 1e-9].map(ceilingAbove)).toEqual([1, 0.005, 0.02, 0.5, 1, 1, 0.0001]);
  });
});

describe("points", () => {
  it("interpolate extinction, not opacity", () => {
    const middle = matterAt([point(0, 0), point(1, 0.5)], 0.5);
    expect(middle.extinction).toBeCloseTo(extinctionFromOpacity(0.5) / 2, 9);
    expect(opacityAtValue([point(0, 0), point(1, 0.5)], 0.5)).toBeGreaterThan(0.25);
  });

  it("take a step's later point at the step and the last beyond the end", () => {
    const step = [point(0, 0), point(0.5, 0), point(0.5, 0.6)];
    expect(opacityAtValue(step, 0.4999)).toBeCloseTo(0, 9);
    expect(opacityAtValue(step, 0.5)).toBeCloseTo(0.6, 9);
    expect(opacityAtValue(step, 1)).toBeCloseTo(0.6, 9);
  });

  it("stay between their neighbours and keep their material", () => {
    const moved = movePoint(points, 1, 0.9, 0.5);
    expect(moved[1]).toMatchObject({ s: 0.6, opacity: 0.5, material: "bone" });
    expect(moved[0]).toBe(points[0]);
  });

  it("move as a band until a neighbour is met", () => {
    const moved = movePoints(points, [1, 2], 0.9, 0.1, linear);
    expect(moved.map((p) => p.s)).toEqual([0, 0.8, 1, 1]);
    expect(moved[1]?.opacity).toBeCloseTo(0.3, 9);
    expect(moved[2]?.opacity).toBeCloseTo(0.9, 9);
    expect(movePoints(points, [0, 1], -0.5, 0, linear)[0]).toMatchObject({ s: 0, opacity: 0 });
  });

  it("stay ascending beside places that are not round", () => {
    const third = 1 / 3;
    const steps = [point(0, 0), point(third, 0), point(third, 1), point(2 * third, 1), point(2 * third, 0), point(1, 0)];
    const ascend = (moved: readonly TransferFunctionPoint[]) => moved.every((p, i) => i === 0 || p.s >= (moved[i - 1]?.s ?? 0));
    expect(ascend(movePoints(steps, [2, 3], 0, -0.5, linear))).toBe(true);
    expect(ascend(movePoint(steps, 2, 0, 0.5))).toBe(true);
    expect(ascend(movePoint(steps, 3, 1, 0.5))).toBe(true);
    expect(ascend(addPoint(steps, third + 1e-9, 0.5).points)).toBe(true);
  });

  it("move together, each run of them up to the points that stay", () => {
    const moved = movePoints(points, [0, 2], 0.5, -0.1, linear);
    // The first one may go on to the second, 0.4 away; the third as far as the last.
    expect(moved.map(({ s }) => s)).toEqual([0.4, 0.4, 1, 1]);
    expect(moved.map(({ opacity }) => opacity)).toEqual([0, 0.2, 0.7, 1]);
    expect(movePoints(points, [0, 1, 2, 3], 0.5, 0, linear)).toEqual(points);
    expect(movePoints(points, [1], 0, 0.5, { axis: "linear", ceiling: 0.1 })[1]?.opacity).toBeCloseTo(0.25, 9);
  });

  it("are put in the place of those they cover", () => {
    const added = insertPoints(points, [point(0.3, 0.5), point(0.5, 0.6)]);
    expect(added.points.map(({ s }) => s)).toEqual([0, 0.3, 0.5, 0.6, 1]);
    expect(added.indices).toEqual([1, 2]);
    const steps = [point(0, 0), point(0.3, 0.1), point(0.3, 0.2), point(0.6, 0.2), point(0.6, 0.1), point(1, 0)];
    expect(insertPoints(steps, steps.slice(2, 4)).points).toEqual(steps);
    expect(insertPoints(steps, steps.slice(2, 3)).points).toEqual(steps);
  });

  it("have most room in their widest gap", () => {
    expect(widestGap(points)).toBeCloseTo(0.2, 12);
    expect(widestGap([point(0.2, 0), point(0.3, 1)])).toBeCloseTo(0.65, 12);
  });

  it("are added with the matter found there", () => {
    const added = addPoint(points, 0.5, 0.33);
    expect(added.index).toBe(2);
    expect(added.points[2]).toMatchObject({ s: 0.5, opacity: 0.33, material: "bone" });
    expect(added.points).toHaveLength(5);
    expect(addPoint([point(0, 0.2), point(1, 0.2)], 0.5, null).points[1]?.opacity).toBeCloseTo(0.2, 6);
  });

  it("never all go", () => {
    expect(removePoints(points, [0, 2])).toEqual([points[1], points[3]]);
    expect(removePoints(points, [0, 1, 2, 3])).toEqual([points[0]]);
  });

  it("change alone", () => {
    const changed = changePoints(points, [2], (p) => ({ ...p, albedo: [1, 0, 0] }));
    expect(changed[2]?.albedo).toEqual([1, 0, 0]);
    expect(changed[1]).toBe(points[1]);
  });
});

describe("another value range", () => {
  const from: Range = [0, 100];
  const curve = [
    point(0, 0, { albedo: [0, 0, 0] }), point(0.2, 0.1), point(0.6, 0.5, { material: "bone", emission: [0, 1, 0] }), point(0.6, 0.9, { albedo: [1, 0, 0] }), point(1, 0.2),
  ];
  const matter = (of: readonly TransferFunctionPoint[], value: number, range: Range) => matterAt(of, positionOf(value, range));

  it("wider: every point keeps its data value", () => {
    const to: Range = [-100, 300];
    const moved = ontoRange(curve, from, to);
    expect(moved).toHaveLength(curve.length);
    for (const [index, p] of moved.entries()) expect(valueOf(p.s, to)).toBeCloseTo(valueOf(curve[index]?.s ?? NaN, from), 3);
    expect(moved[2]).toMatchObject({ opacity: 0.5, material: "bone" });
  });

  it.each<Range>([[10, 80], [20, 60], [30, 50], [-20, 70], [65, 140]])("%d to %d: the curve in it stays, cut at the ends", (low, high) => {
    const to: Range = [low, high];
    const moved = ontoRange(curve, from, to);
    expect(moved.length).toBeLessThanOrEqual(curve.length);
    expect(moved.every((p, i) => p.s >= (moved[i - 1]?.s ?? 0) && p.s <= 1)).toBe(true);
    for (const share of [0.001, 0.2, 0.5, 0.77, 0.999]) {
      const value = valueOf(share, to);
      const [was, is] = [matter(curve, value, from), matter(moved, value, to)];
      expect(is.extinction).toBeCloseTo(was.extinction, 2);
      expect(is.material).toBe(value < 0 ? undefined : was.material);
      for (const axis of [0, 1, 2]) {
        expect(is.albedo[axis]).toBeCloseTo(was.albedo[axis] ?? NaN, 4);
        expect(is.emission[axis]).toBeCloseTo(was.emission[axis] ?? NaN, 4);
      }
    }
  });

  it("keeps extinction where it was given, and does not cut at a point", () => {
    const dense: TransferFunctionPoint[] = [{ s: 0, extinction: 0, albedo: [1, 1, 1], emission: [0, 0, 0] }, { s: 1, extinction: 5000, albedo: [1, 1, 1], emission: [0, 0, 0] }];
    expect(ontoRange(dense, from, [0, 50])[1]).toMatchObject({ s: 1, extinction: 2500 });
    expect(ontoRange(curve, from, [0, 60]).map(({ s }) => s)).toEqual([0, 0.3333333, 1, 1]);
  });

  it("leaves the cut ends where they are when it is widened again", () => {
    const cut = ontoRange(curve, from, [10, 40]);
    const back = ontoRange(cut, [10, 40], from);
    expect(back).toHaveLength(3);
    for (const [index, s] of [0.1, 0.2, 0.4].entries()) expect(back[index]?.s).toBeCloseTo(s, 6);
  });

  it("has matter to show where the curve lies beyond it", () => {
    expect(ontoRange(curve, from, [200, 300])).toMatchObject([{ s: 0, opacity: 0.2 }]);
    expect(ontoRange([point(0.5, 0.3)], from, [0, 10])).toMatchObject([{ s: 1, opacity: 0.3 }]);
    expect(ontoRange([point(0, 0), point(1, 0.5)], from, [40, 60]).map(({ s }) => s)).toEqual([0, 1]);
  });
});

describe("the value axis", () => {
  it("zooms about the pointer and stays inside", () => {
    const [low, high] = zoomWindow([0, 1], 0.25, 0.5);
    expect((0.25 - low) / (high - low)).toBeCloseTo(0.25, 12);
    expect(zoomWindow([0.4, 0.6], 0.5, 100)).toEqual([0, 1]);
    expect(panWindow([0.2, 0.4], -1)).toEqual([0, 0.2]);
  });

  it("has round ticks", () => {
    expect(ticks([-1000, 3000], 4)).toEqual([-1000, 0, 1000, 2000, 3000]);
    expect(ticks([0, 0.35], 4)).toEqual([0, 0.1, 0.2, 0.3]);
    expect(formatValue(1234567)).toBe("1.2e+6");
    expect(formatValue(0.25)).toBe("0.25");
  });

  it("shows integer data without decimals, but not few of them", () => {
    const of = (voxel_type: VoxelType, high: number) => wholeValues({ voxel_type, value_range: [0, high] });
    expect(of("int16", 4000)).toBe(true);
    expect(of("uint8", 32)).toBe(false);
    expect(of("float32", 4000)).toBe(false);
    expect(formatData(-12345.6, true)).toBe("-12346");
    expect(formatData(0.25, false)).toBe("0.25");
  });

  it("keeps the fullest bucket of each column", () => {
    const histogram: Histogram = { value_range: [0, 4], counts: [10, 0, 5, 1], bin_edges: [], bin_shares: [] };
    expect(histogramColumns(histogram, [0, 4], 2, false)).toEqual([1, 0.5]);
    expect(histogramColumns(histogram, [0, 8], 2, false)).toEqual([1, 0]);
    expect(histogramColumns(histogram, [0, 4], 4, true)[2]).toBeCloseTo(Math.log(6) / Math.log(11), 12);
    // Zoomed, what is seen fills the height.
    expect(histogramColumns(histogram, [2, 4], 2, false)).toEqual([1, 0.2]);
  });
});

describe("presets", () => {
  const counts = Array.from({ length: 100 }, (_, i) => (i < 20 ? 1000 : i > 70 && i < 90 ? 200 : 0));
  const ct: Histogram = { value_range: [-1000, 3000], counts, bin_edges: [], bin_shares: [] };

  it("find the value between two groups", () => {
    const threshold = otsuThreshold(ct);
    expect(threshold).toBeGreaterThan(-200);
    expect(threshold).toBeLessThan(1840);
    expect(quantile(ct, 0.5)).toBeLessThan(-200);
  });

  it("are valid transfer functions", () => {
    expect(looksLikeCt(ct)).toBe(true);
    const presets = presetsFor(ct, [-1000, 3000]);
    expect(presets.map((preset) => preset.id)).toContain("ct");
    for (const preset of presets) {
      for (const [index, p] of preset.points.entries()) {
        expect(p.s).toBeGreaterThanOrEqual(preset.points[index - 1]?.s ?? 0);
        expect(p.s).toBeLessThanOrEqual(1);
        if (p.material !== undefined) expect(preset.materials).toHaveProperty(p.material);
      }
    }
  });

  it("show bone and nothing below it", () => {
    const range: Range = [-1000, 3000];
    const bone = presetsFor(ct, range).find((preset) => preset.id === "bone")?.points ?? [];
    expect(opacityAtValue(bone, positionOf(179, range))).toBe(0);
    expect(opacityAtValue(bone, positionOf(300, range))).toBeGreaterThan(0.5);
    expect(opacityAtValue(bone, 1)).toBeGreaterThan(0.9);
  });

  it("offer Hounsfield units only where they are", () => {
    expect(presetsFor({ ...ct, value_range: [0, 255] }, [0, 255]).map((p) => p.id)).not.toContain("ct");
  });
});

describe("the cost of an edit", () => {
  // Labels 0, 1 and 9: two bins with width, and the largest value in the last of many without.
  const edges = [0, 0.5, 5, ...Array.from({ length: 62 }, () => 9)];
  const shares = [0.8, 0.3, ...Array.from({ length: 62 }, (_, i) => (i === 61 ? 0.02 : 0.3))];
  const labels: Histogram = { value_range: [0, 9], counts: [], bin_edges: edges, bin_shares: shares };

  it("is that of the bins a column touches, the largest of them", () => {
    const bins = costBins(labels, null);
    expect(bins.map(({ low, high }) => [low, high])).toEqual([[0, 0.5], [0.5, 5], [5, 9], [9, 9]]);
    expect(costRuns(bins, [0, 9], 9)).toEqual([{ from: 0, to: 1, share: 0.8, ofVolume: 0.8 }, { from: 1, to: 9, share: 0.3, ofVolume: 0.3 }]);
    // Only the last value is in the last column of a window that begins beyond its neighbours.
    expect(costRuns(bins, [8, 10], 2)).toEqual([{ from: 0, to: 1, share: 0.3, ofVolume: 0.3 }, { from: 1, to: 2, share: 0.02, ofVolume: 0.02 }]);
  });

  it("is nothing beyond the data", () => {
    const runs = costRuns(costBins(labels, null), [-9, 18], 27);
    expect(runs.map(({ from, share }) => [from, share])).toEqual([[0, 0], [9, 0.8], [10, 0.3], [18, 0.02], [19, 0]]);
  });

  it("is said in words", () => {
    const ofVolume = (share: number): string => costInWords({ share, ofVolume: share }, null);
    expect(ofVolume(0)).toBe("touches nothing");
    expect(ofVolume(0.0004)).toBe("touches less than 0.1 % of the volume");
    expect(ofVolume(0.0123)).toBe("touches 1.2 % of the volume");
    expect(ofVolume(0.12)).toBe("touches 12 % of the volume");
    expect(ofVolume(0.999)).toBe("touches 99 % of the volume");
    expect(ofVolume(1)).toBe("touches all of the volume");
    expect(stripInWords(null)).toMatch(/volume/);
  });

  it("is that of what is kept, where that is known", () => {
    const photons = { what: "photons", counted: 4096, of_bins: [1, 0.5, ...Array.from({ length: 62 }, () => 0)] };
    const bins = costBins(labels, photons);
    expect(bins.map(({ share, ofVolume }) => [share, ofVolume])).toEqual([[1, 0.8], [0.5, 0.3], [0, 0.3], [0, 0.02]]);
    expect(costRuns(bins, [0, 9], 9)[1]).toEqual({ from: 1, to: 5, share: 0.5, ofVolume: 0.3 });
    expect(costInWords({ share: 0.5, ofVolume: 0.3 }, photons)).toBe("recomputes 50 % of the photons, for 30 % of the volume");
    expect(costInWords({ share: 0, ofVolume: 0.02 }, photons)).toBe("recomputes none of the photons, for 2 % of the volume");
    expect(stripInWords(photons)).toMatch(/photons/);
    expect(sharesOf("photon_map", photons)).toBe(photons);
    expect(sharesOf("path_traced", photons)).toBeNull();
    expect(sharesOf("path_traced", { ...photons, what: "tiles" })).not.toBeNull();
    expect(sharesOf("local", photons)).toBeNull();
  });
});

describe("the region in view", () => {
  const scene = (clip: object): SceneFile => ({ volume: { builtin: "pillars", filter: "linear" }, clip: { planes: [], shadows: false, ...clip } }) as unknown as SceneFile;
  const box = [[0, 0, 0], [1, 1, 0.5]];

  it("is nothing of its own while nothing is cut", () => {
    expect(regionOf("a", scene({}))).toBeNull();
    expect(regionOf(null, scene({ box }))).toBeNull();
  });

  it("changes with what is cut, and not with how it is drawn", () => {
    const region = regionOf("a", scene({ box }));
    expect(region).not.toBeNull();
    expect(regionOf("a", scene({ box, shadows: true }))).toBe(region);
    expect(regionOf("b", scene({ box }))).not.toBe(region);
    expect(regionOf("a", scene({ box, planes: [{ normal: [1, 0, 0], offset: 0 }] }))).not.toBe(region);
    expect(regionOf("a", { ...scene({ box }), volume: { builtin: "pillars", filter: "nearest" } })).toBe(region);
    expect(regionOf("a", { ...scene({ box }), volume: { dataset: "x", filter: "linear" } })).not.toBe(region);
  });
});

describe("pictures of presets", () => {
  const scene = { density: 1, camera: { fov_y_degrees: 30 }, transfer_function: { points }, image: { width: 1 }, sampling: { samples_per_pixel: 4, step_voxels: 1 } } as unknown as SceneFile;

  it("depend on the patch and on all that it leaves", () => {
    const key = pictureKey(scene, { transfer_function: { points: [] } });
    expect(pictureKey({ ...scene, camera: { fov_y_degrees: 40 } } as unknown as SceneFile, { transfer_function: { points: [] } })).toBe(key);
    expect(pictureKey({ ...scene, transfer_function: { points: [] } }, { transfer_function: { points: [] } })).toBe(key);
    expect(pictureKey(scene, { transfer_function: { points } })).not.toBe(key);
    expect(pictureKey({ ...scene, density: 2 }, { transfer_function: { points: [] } })).not.toBe(key);
  });

  it("are kept while they are used", () => {
    const dropped: string[] = [];
    const cache = new PictureCache(2, (address) => dropped.push(address));
    cache.keep("a", "1");
    cache.keep("b", "2");
    expect(cache.get("a")).toBe("1");
    cache.keep("c", "3");
    expect(dropped).toEqual(["2"]);
    expect([cache.get("a"), cache.get("b"), cache.get("c")]).toEqual(["1", null, "3"]);
    cache.keep("a", "4");
    expect(dropped).toEqual(["2", "1"]);
  });
});
