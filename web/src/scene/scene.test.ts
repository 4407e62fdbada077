import { describe, expect, it } from "vitest";
import { hexFromLinear, linearFromHex, withStrength } from "./colour";
import { amend, emptyHistory, forgetLast, MAX_STEPS, record, redo, undo, type History } from "./history";
import { applyPatch, composePatches, deepEqual, diffPatch, isEmptyPatch, shareStructure } from "./mergePatch";

describe("merge patches", () => {
  it("follow RFC 7396", () => {
    expect(applyPatch({ a: { b: "c" } }, { a: { b: "d", c: null } })).toEqual({ a: { b: "d" } });
    expect(applyPatch({ a: [1, 2] }, { a: [3] })).toEqual({ a: [3] });
    expect(applyPatch({ a: 1 }, { a: { b: { c: null } } })).toEqual({ a: { b: {} } });
  });

  it("share what they do not touch", () => {
    const before = { a: { x: 1 }, b: { y: 2 } };
    expect(applyPatch(before, { b: { y: 3 } }).a).toBe(before.a);
  });

  it.each([
    [{ a: 1, b: { c: 2, d: 3 } }, { a: 1, b: { c: 2 }, e: [1] }],
    [{ a: [1] }, { a: { b: 1 } }],
    [{ a: { type: "hg", g: 0.5 } }, { a: { type: "isotropic" } }],
  ])("are derived so that they lead from one document to the other (%#)", (from, to) => {
    expect(applyPatch<object>(from, diffPatch(from, to))).toEqual(to);
    expect(applyPatch<object>(to, diffPatch(to, from))).toEqual(from);
    expect(isEmptyPatch(diffPatch(from, structuredClone(from)))).toBe(true);
  });

  it("compose into one that does the same", () => {
    const document = { a: 1, b: { c: 2, d: 3 } };
    const first = { a: null, b: { c: 5 } };
    const second = { b: { d: null }, e: 1 };
    const composed = composePatches(first, second);
    expect(composed && applyPatch<object>(document, composed)).toEqual(applyPatch<object>(applyPatch<object>(document, first), second));
  });

  it("refuse to compose where one patch cannot say it", () => {
    expect(composePatches({ a: null }, { a: { b: 1 } })).toBeNull();
    expect(composePatches({ x: { a: [1] } }, { x: { a: { b: 1 } } })).toBeNull();
  });

  it("keep the identity of equal parts", () => {
    const before = { a: { x: [1, 2] }, b: 1 };
    const shared = shareStructure(before, { a: { x: [1, 2] }, b: 2 });
    expect(shared.a).toBe(before.a);
    expect(shared.b).toBe(2);
    expect(deepEqual(Number.NaN, Number.NaN)).toBe(true);
  });
});

describe("undo and redo", () => {
  const step = (n: number) => ({ undo: { n: n - 1 }, redo: { n } });

  it("walk back and forth", () => {
    const history = record(record(emptyHistory, step(1)), step(2));
    const back = undo(history);
    expect(back?.patch).toEqual({ n: 1 });
    const forth = redo(back?.history ?? emptyHistory);
    expect(forth?.patch).toEqual({ n: 2 });
    expect(forth?.history).toEqual(history);
    expect(undo(emptyHistory)).toBeNull();
    expect(redo(history)).toBeNull();
  });

  it("forget what was undone after a new step", () => {
    const back = undo(record(emptyHistory, step(1)));
    expect(record(back?.history ?? emptyHistory, step(5)).future).toEqual([]);
  });

  it("amend, forget and stay bounded", () => {
    expect(amend(record(emptyHistory, step(1)), step(2)).past).toEqual([step(2)]);
    expect(forgetLast(record(emptyHistory, step(1))).past).toEqual([]);
    let history: History = emptyHistory;
    for (let n = 0; n < MAX_STEPS + 5; n += 1) history = record(history, step(n));
    expect(history.past).toHaveLength(MAX_STEPS);
  });
});

describe("colours", () => {
  it("survive the way to the picker and back", () => {
    for (const hex of ["#000000", "#ffffff", "#336699", "#e0a458"]) {
      const linear = linearFromHex(hex);
      expect(linear && hexFromLinear(linear)).toBe(hex);
    }
    expect(linearFromHex("teal")).toBeNull();
  });

  it("have a hue and a strength", () => {
    expect(withStrength([2, 1, 0], 4)).toEqual([4, 2, 0]);
    expect(withStrength([0, 0, 0], 3)).toEqual([3, 3, 3]);
  });
});
