import { describe, expect, it } from "vitest";
import { FORMAT_JPEG, FRAME_HEADER_BYTES, FRAME_MAGIC, type FrameHeader } from "../generated/proto";
import { FrameReceiver, parseFrame } from "./frames";

/** A frame as the service writes it: the header's fields in order, then the payload. */
function frame(number: number, payload = [1, 2, 3], format = FORMAT_JPEG): ArrayBuffer {
  const buffer = new ArrayBuffer(FRAME_HEADER_BYTES + payload.length);
  const view = new DataView(buffer);
  view.setUint32(0, FRAME_MAGIC, true);
  view.setUint16(4, FRAME_HEADER_BYTES, true);
  view.setUint8(6, format);
  view.setUint32(8, number, true);
  view.setUint32(12, 42, true);
  view.setFloat32(32, NaN, true);
  view.setUint16(36, 640, true);
  view.setUint32(60, payload.length, true);
  new Uint8Array(buffer, FRAME_HEADER_BYTES).set(payload);
  return buffer;
}

describe("a binary message", () => {
  it("is split into header and picture", async () => {
    const parsed = parseFrame(frame(7));
    expect(parsed?.header).toMatchObject({ frame: 7, seq: 42, width: 640 });
    expect(parsed?.payload.type).toBe("image/jpeg");
    expect(new Uint8Array((await parsed?.payload.arrayBuffer()) ?? new ArrayBuffer(0))).toEqual(new Uint8Array([1, 2, 3]));
  });

  it("is refused when it is cut off, foreign or of unknown format", () => {
    expect(parseFrame(frame(1).slice(0, -1))).toBeNull();
    expect(parseFrame(frame(1).slice(1))).toBeNull();
    expect(parseFrame(frame(1, [1], 77))).toBeNull();
  });
});

/** A receiver whose decoder finishes when told to. */
function harness() {
  const shown: number[] = [];
  const acknowledged: number[] = [];
  const damaged: string[] = [];
  const finish: (() => void)[] = [];
  const receiver = new FrameReceiver<Blob>({
    decode: (payload) => new Promise((resolve, reject) => finish.push(() => { if (payload.size > 1) resolve(payload); else reject(new Error("bad")); })),
    show: (_: Blob, header: FrameHeader) => shown.push(header.frame),
    acknowledge: (number) => acknowledged.push(number),
    damaged: (reason) => damaged.push(reason),
    now: () => 0,
  });
  const decodeOne = async () => {
    finish.shift()?.();
    await new Promise((resolve) => setTimeout(resolve));
  };
  return { receiver, shown, acknowledged, damaged, decodeOne };
}

describe("the receiver", () => {
  it("decodes only the newest waiting frame and acknowledges all", async () => {
    const { receiver, shown, acknowledged, decodeOne } = harness();
    for (const number of [1, 2, 3, 4]) receiver.receive(frame(number));
    expect(acknowledged).toEqual([2, 3]);
    await decodeOne();
    await decodeOne();
    expect(shown).toEqual([1, 4]);
    expect(acknowledged).toEqual([2, 3, 1, 4]);
  });

  it("acknowledges a picture that cannot be decoded, and says so", async () => {
    const { receiver, shown, acknowledged, damaged, decodeOne } = harness();
    receiver.receive(frame(1, [0]));
    await decodeOne();
    expect(shown).toEqual([]);
    expect(acknowledged).toEqual([1]);
    expect(damaged).toHaveLength(1);
    receiver.receive(new ArrayBuffer(3));
    expect(damaged).toHaveLength(2);
  });

  it("is silent after the connection is gone", async () => {
    const { receiver, shown, acknowledged, decodeOne } = harness();
    receiver.receive(frame(1));
    receiver.receive(frame(2));
    receiver.close();
    await decodeOne();
    expect(shown).toEqual([]);
    expect(acknowledged).toEqual([]);
  });
});
