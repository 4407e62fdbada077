import { describe, expect, it } from "vitest";
import { normalize } from "../scene/vec";
import { lookFrom, orbit } from "./camera";
import { edgeLetters, letterOf } from "./patientSides";
import { defaultCamera, standardViews } from "./views";

const start = { ...defaultCamera(null), up: [0, 0, 1] as [number, number, number], position: [0, -2.5, 0] as [number, number, number] };

describe("letters at the edges", () => {
  it("follow the patient's axes", () => {
    expect([letterOf([1, 0, 0]), letterOf([-1, 0, 0])]).toEqual(["L", "R"]);
    expect([letterOf([0, 1, 0]), letterOf([0, -1, 0])]).toEqual(["P", "A"]);
    expect([letterOf([0, 0, 1]), letterOf([0, 0, -1])]).toEqual(["S", "I"]);
  });

  it("are two between the axes, the nearer first", () => {
    expect(letterOf(normalize([-0.6, -0.65, 0.46]))).toBe("AR");
    expect(letterOf(normalize([0.1, 0.5, 0.9]))).toBe("S");
  });

  it("show the patient's right on the left from the front, and from the feet", () => {
    expect(edgeLetters(start)).toEqual({ top: "S", right: "L", bottom: "I", left: "R" });
    const bottom = standardViews(true).find(({ name }) => name === "bottom");
    if (!bottom) throw new Error("no view from the feet");
    expect(edgeLetters(lookFrom(start, bottom.from, bottom.up))).toEqual({ top: "A", right: "L", bottom: "P", left: "R" });
  });

  it("turn with the camera", () => {
    const turned = edgeLetters(orbit(start, Math.PI / 2, 0, [0, 0, 1]));
    expect(turned.top).toBe("S");
    expect([turned.left, turned.right].sort()).toEqual(["A", "P"]);
  });
});
