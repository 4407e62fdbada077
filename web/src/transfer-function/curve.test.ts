import { describe, expect, it } from "vitest";
import type { TransferFunctionPoint } from "../generated/proto";
import { srgbFromLinear } from "../scene/colour";
import { colourAtOf, colourMapGroups, cssGradient, linearFromCss } from "./colourMaps";
import { curveText, onto, placed, readCurve } from "./curveFile";
import { ceilingFor, pointsWithin, type Plot } from "./geometry";
import { matterAt } from "./points";
import { recolour, throughStops, visibleSpan } from "./recolour";
import { withToggled, zoomAndPan } from "./selection";
import type { Range } from "./valueAxis";

const point = (s: number, opacity: number, extra: Partial<TransferFunctionPoint> = {}): TransferFunctionPoint => ({
  s, opacity, albedo: [1, 1, 1], emission: [0, 0, 0], ...extra,
});
const bone = { phase: { type: "isotropic" as const }, surface: 0 };
const curve = [point(0, 0), point(0.4, 0.02, { material: "bone" }), point(0.6, 0.8), point(1, 1)];

describe("a selection", () => {
  const plot: Plot = { left: 0, top: 0, width: 100, height: 100, window: [0, 1], axis: "linear", ceiling: 1 };

  it("takes the points whose handles lie in a rectangle, drawn from any corner", () => {
    expect(pointsWithin(plot, curve, { x: 70, y: 10, toX: 30, toY: 100 })).toEqual([1, 2]);
    expect(pointsWithin(plot, curve, { x: 30, y: 50, toX: 70, toY: 100 })).toEqual([1]);
    expect(pointsWithin({ ...plot, window: [0.5, 1] }, curve, { x: 0, y: 0, toX: 50, toY: 100 })).toEqual([2]);
  });

  it("gains and loses single points", () => {
    expect(withToggled([0, 3], 2)).toEqual([0, 2, 3]);
    expect(withToggled([0, 2, 3], 2)).toEqual([0, 3]);
  });
});

describe("the window", () => {
  it("fits the opacity axis where it is zoomed, and only there", () => {
    expect(ceilingFor(curve, [0, 1])).toBe(1);
    expect(ceilingFor(curve, [0.3, 0.41])).toBeLessThan(0.5);
    expect(ceilingFor(curve, [0, 0.4])).toBe(0.05);
    expect(ceilingFor([point(0, 0), point(1, 0)], [0.2, 0.4])).toBe(1);
  });

  it("keeps what two fingers hold under them", () => {
    const [low, high] = zoomAndPan([0, 1], [0.4, 0.6], [0.25, 0.75]);
    expect(low + 0.25 * (high - low)).toBeCloseTo(0.4, 12);
    expect(low + 0.75 * (high - low)).toBeCloseTo(0.6, 12);
    expect(zoomAndPan([0, 1], [0.4, 0.6], [0.45, 0.55])).toEqual([0, 1]);
    expect(zoomAndPan([0.2, 0.4], [0.3, 0.3], [0.5, 0.5])).toEqual([0.2, 0.4]);
  });
});

describe("text of a transfer function", () => {
  const range: Range = [0, 200];

  it("comes back as it was, with the materials it names", () => {
    const text = curveText(curve, range, { bone, other: bone }, false);
    expect(readCurve(text)).toEqual({ kind: "curve", range, points: curve, materials: { bone }, part: false });
    expect(JSON.parse(text)).not.toHaveProperty("part");
    expect(readCurve(curveText(curve.slice(1, 3), range, {}, true))).toMatchObject({ part: true });
  });

  it.each([
    ["", /not a transfer function/], ["[]", /not a transfer function/], ["null", /not a transfer function/], ["7", /not a transfer function/],
    ['{"transfer_function": {"points": []}}', /not a transfer function/],
    ['{"transfer_function": {"points": [{"s": 2}]}}', /from 0 to 1/],
    ['{"transfer_function": {"points": [null]}}', /from 0 to 1/],
    ['{"transfer_function": {"points": [{"s": 0, "albedo": "red"}]}}', /three numbers/],
    ['{"transfer_function": {"points": [{"s": 0, "opacity": "1"}]}}', /must be a number/],
    ['{"transfer_function": {"points": [{"s": 0}]}, "materials": {"a": 1}}', /materials/],
    ['{"value_range": null, "transfer_function": {"points": [{"s": 0.6}]}}', /value range/],
    ['{"transfer_function": {"points": [{"s": 0.6}, {"s": 0.5}]}}', /ascend/],
    ['{"value_range": [1, 1], "transfer_function": {"points": [{"s": 0.6}]}}', /value range/],
  ])("is refused in words: %s", (text, words) => {
    expect(() => readCurve(text)).toThrow(words);
  });

  it("keeps its data values over another range, and is stretched where none of them occurs", () => {
    const moved = onto(curve, range, [0, 400]);
    expect(moved.stretched).toBe(false);
    expect(moved.points.map(({ s }) => s)).toEqual([0, 0.2, 0.3, 0.5]);
    expect(onto(curve, range, [1000, 1200])).toEqual({ points: curve, stretched: true });
  });

  it("of a scene without a value range is that of any volume", () => {
    const read = readCurve('{"version": 1, "volume": {}, "transfer_function": {"points": [{"s": 0.5, "opacity": 0.1}]}}');
    expect(read).toMatchObject({ range: null, points: [{ s: 0.5, opacity: 0.1, albedo: [1, 1, 1] }] });
    if (read.kind === "curve") expect(onto(read.points, read.range, [5, 9]).points[0]?.s).toBe(0.5);
  });

  it("of a part begins where it is put", () => {
    const part = curve.slice(1, 3);
    expect(placed([point(1 / 3, 1)], range, range, null)[0]?.s).toBe(1 / 3);
    expect(placed(part, range, [0, 400], null).map(({ s }) => s)).toEqual([0.2, 0.3]);
    expect(placed(part, range, [0, 400], 0.95).map(({ s }) => s)).toEqual([0.95]);
  });
});

describe("files of other programs", () => {
  it("a volume property of 3D Slicer", () => {
    const read = readCurve("1\n1\n0.2\n1\n0\n1\n6 -1000 0 100 0 300 0.5\n4 0 1 255 1\n8 -1000 0 0 0 300 1 0.5 0\n");
    expect(read).toMatchObject({ kind: "curve", range: [-1000, 300], part: false });
    if (read.kind !== "curve") return;
    expect(read.points.map(({ opacity }) => opacity)).toEqual([0, 0, 0.5]);
    expect(srgbFromLinear(read.points[2]?.albedo[1] ?? NaN)).toBeCloseTo(0.5, 3);
  });

  it("a colour map of ParaView, with opacities and without", () => {
    const colours = { Name: "x", RGBPoints: [0, 0, 0, 0, 10, 1, 1, 1] };
    const read = readCurve(JSON.stringify([{ ...colours, Points: [0, 0, 0.5, 0, 5, 0.4, 0.5, 0] }]));
    expect(read).toMatchObject({ kind: "curve", range: [0, 10], points: [{ s: 0, opacity: 0 }, { s: 0.5, opacity: 0.4 }, { s: 1, opacity: 0.4 }] });
    const alone = readCurve(JSON.stringify([colours]));
    expect(alone.kind).toBe("colours");
    if (alone.kind === "colours") expect(srgbFromLinear(alone.at(0.5)[0])).toBeCloseTo(0.5, 9);
  });
});

describe("colour maps", () => {
  const maps = colourMapGroups.flatMap((group) => group.maps);

  it("have ids of their own and colours at both ends", () => {
    expect(new Set(maps.map(({ id }) => id)).size).toBe(maps.length);
    for (const map of maps) for (const t of [0, 0.5, 1]) for (const channel of colourAtOf(map, false)(t)) expect(channel).toBeGreaterThanOrEqual(0);
    expect(linearFromCss("rgb(255, 0, 0)")).toEqual([1, 0, 0]);
    expect(linearFromCss("#00ff00")).toEqual([0, 1, 0]);
    const [first] = maps;
    if (first) expect(cssGradient(first, true)).toContain(first.css(1));
  });

  it.each(maps.map((map) => [map.id, map] as const))("%s: the curve stays and the colours follow closely", (_, map) => {
    const at = colourAtOf(map, false);
    const span = visibleSpan(curve);
    const painted = recolour(curve, at, span);
    expect(painted.length).toBeLessThan(60);
    for (let s = 0.005; s < 1; s += 0.01) {
      const [was, is] = [matterAt(curve, s), matterAt(painted, s)];
      expect(Math.abs(is.extinction - was.extinction)).toBeLessThanOrEqual(1e-3 * was.extinction);
      expect(is.material).toBe(was.material);
      const wanted = at((s - span[0]) / (span[1] - span[0]));
      for (const axis of [0, 1, 2]) expect(Math.abs(srgbFromLinear(is.albedo[axis] ?? NaN) - srgbFromLinear(wanted[axis] ?? NaN))).toBeLessThan(0.06);
    }
  });

  it("leave no points of another map behind", () => {
    const [viridis, magma] = maps.map((map) => colourAtOf(map, false));
    if (!viridis || !magma) throw new Error("two maps");
    const straight = recolour(curve, magma, [0, 1]);
    const after = recolour(recolour(curve, viridis, [0, 1]), magma, [0, 1]);
    expect(after.map(({ s }) => s)).toEqual(straight.map(({ s }) => s));
  });

  it("are laid over what has matter", () => {
    expect(visibleSpan([point(0, 0), point(0.3, 0), point(0.5, 0.2), point(0.7, 0), point(1, 0)])).toEqual([0.3, 0.7]);
    expect(visibleSpan([point(0.2, 0.1)])).toEqual([0, 1]);
    expect(visibleSpan([point(0, 0)])).toEqual([0, 1]);
    const inner = recolour(curve, throughStops([{ t: 0, srgb: [1, 0, 0] }, { t: 1, srgb: [0, 0, 1] }]), [0.4, 0.6]);
    expect(inner[0]).toBe(curve[0]);
    expect(matterAt(inner, 0.41).albedo[1]).toBe(0);
  });
});
