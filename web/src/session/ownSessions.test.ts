import { afterAll, beforeEach, describe, expect, it, vi } from "vitest";
import { editableId, listedId, rememberSession } from "./ownSessions";

describe("sessions this browser may edit", () => {
  const kept = new Map<string, string>();
  const localStorage = { getItem: (key: string) => kept.get(key) ?? null, setItem: (key: string, text: string) => void kept.set(key, text) };
  beforeEach(() => {
    kept.clear();
    vi.stubGlobal("window", { localStorage });
  });
  afterAll(() => vi.unstubAllGlobals());

  it("are those it opened, by the identifier they are listed under", () => {
    rememberSession({ id: "edit", role: "editor", watch: "watch" });
    rememberSession({ id: "watched", role: "watcher" });
    expect([editableId("watch"), editableId("watched"), editableId("edit")]).toEqual(["edit", null, null]);
    expect([listedId("edit"), listedId("watched")]).toEqual(["watch", "watched"]);
  });

  it("are bounded, and survive what others put there", () => {
    for (let n = 0; n < 150; n += 1) rememberSession({ id: `e${n}`, role: "editor", watch: `w${n}` });
    expect([editableId("w0"), editableId("w149")]).toEqual([null, "e149"]);
    for (const text of ["{", "7", '[1, ["a"], ["w", 3]]']) {
      kept.set("tyndall.sessions", text);
      expect(editableId("w")).toBeNull();
    }
  });
});
