import { describe, expect, it } from "vitest";
import { dot, length, sub, type Triple } from "../scene/vec";
import { edgesOf, faceCentre, isSeen, outwards, planeCentre, planeOutline, WHOLE, withFace, type Box } from "./clipBox";

const half: Triple = [0.5, 0.4, 0.25];
const box: Box = [[0, 0.2, 0], [1, 1, 0.5]];

describe("faces of the clip box", () => {
  it("move as far as the volume and the opposite face allow", () => {
    expect(withFace(box, 1, 0, 0.1)).toEqual([[0, 0.3, 0], [1, 1, 0.5]]);
    expect(withFace(box, 1, 0, 2)).toEqual([[0, 0.995, 0], [1, 1, 0.5]]);
    expect(withFace(box, 2, 1, 9)).toEqual([[0, 0.2, 0], [1, 1, 1]]);
    expect(withFace(WHOLE, 0, 1, 1)).toBeNull();
  });

  it("lie in the world where the volume does", () => {
    expect(faceCentre(WHOLE, 0, 1, half)).toEqual([0.5, 0, 0]);
    expect(faceCentre(box, 2, 1, half)[2]).toBeCloseTo(0, 12);
    expect(faceCentre(box, 1, 0, half)[1]).toBeCloseTo(-0.24, 12);
  });

  it("are seen from their own side", () => {
    const centre = faceCentre(WHOLE, 0, 1, half);
    expect(isSeen(centre, outwards(0, 1), { place: [2, 0, 0] })).toBe(true);
    expect(isSeen(centre, outwards(0, 1), { place: [0.4, 3, 0] })).toBe(false);
    expect(isSeen(centre, outwards(0, 0), { towards: [0.1, 1, 0] })).toBe(false);
  });

  it("meet in twelve edges of the box's lengths", () => {
    const lengths = edgesOf(WHOLE, half).map(({ ends }) => length(sub(...ends)));
    expect(lengths.filter((edge) => Math.abs(edge - 1) < 1e-9)).toHaveLength(4);
    expect(lengths).toHaveLength(12);
  });
});

describe("planes across the volume", () => {
  it("have four corners across an axis, six across the diagonal, none outside", () => {
    expect(planeOutline({ normal: [1, 0, 0], offset: 0.1 }, half)).toHaveLength(4);
    expect(planeOutline({ normal: [1, 1, 1], offset: 0 }, [0.5, 0.5, 0.5])).toHaveLength(6);
    expect(planeOutline({ normal: [1, 0, 0], offset: 3 }, half)).toEqual([]);
  });

  it("have their corners in order and on the plane", () => {
    const normal: Triple = [0.6, 0.8, 0];
    const outline = planeOutline({ normal, offset: 0.1 }, half);
    for (const corner of outline) expect(dot(corner, normal)).toBeCloseTo(0.1, 9);
    const edges = outline.map((corner, i) => sub(outline[(i + 1) % outline.length] ?? corner, corner));
    for (const [i, edge] of edges.entries()) expect(Math.abs(dot(edge, edges[(i + 1) % edges.length] ?? edge))).toBeLessThan(1e-9);
    expect(dot(planeCentre({ normal, offset: 0.1 }, half), normal)).toBeCloseTo(0.1, 9);
    expect(planeCentre({ normal: [2, 0, 0], offset: 3 }, half)).toEqual([3, 0, 0]);
  });
});
