import { describe, expect, it } from "vitest";
import type { Session } from "../generated/proto";
import { agoInWords, contentOf, inOrder, viewersInWords } from "./sessions";

const session = (id: string, viewers: number, used: number, mode = "volume"): Session =>
  ({ id, epoch: 1, viewers, created_unix_millis: 0, used_unix_millis: used, role: "watcher", scene: { volume: { dataset: "d1", filter: "linear" }, rendering: { mode }, illumination: { method: "local" } } }) as unknown as Session;

describe("the gallery of sessions", () => {
  it("says how long ago", () => {
    const now = 1e12;
    expect([0, 59e3, 60e3, 5 * 60e3, 3600e3, 47 * 3600e3].map((passed) => agoInWords(now - passed, now))).toEqual(["just now", "just now", "1 minute ago", "5 minutes ago", "1 hour ago", "1 day ago"]);
    expect(agoInWords(now + 5000, now)).toBe("just now");
  });

  it("names the volume and how it is drawn", () => {
    expect(contentOf(session("a", 0, 0), [{ id: "d1", name: "Head" }])).toEqual({ name: "Head", drawn: "Local" });
    expect(contentOf(session("a", 0, 0, "slice"), [])).toEqual({ name: "d1", drawn: "Slice" });
  });

  it("counts who looks", () => {
    expect([viewersInWords(1, true), viewersInWords(3, true), viewersInWords(0, false), viewersInWords(1, false), viewersInWords(2, false)])
      .toEqual(["only you", "you and 2 others", "nobody is looking", "1 viewer", "2 viewers"]);
  });

  it("shows one's own first, then what is looked at, then what was used last", () => {
    const all = [session("old", 0, 1), session("new", 0, 2), session("busy", 3, 0), session("mine", 1, 0)];
    expect(inOrder(all, "old").map(({ id }) => id)).toEqual(["old", "busy", "mine", "new"]);
    expect(inOrder(all, "mine").map(({ id }) => id)).toEqual(["mine", "busy", "new", "old"]);
  });
});
