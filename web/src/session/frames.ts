/**
 * Pictures as they arrive: decoded one at a time, always the newest, every one acknowledged.
 *
 * The server keeps at most a few frames in flight and waits for acknowledgements; a frame that
 * was overtaken before it could be decoded is acknowledged without being shown.
 */

import { decodeFrameHeader, FORMAT_JPEG, FORMAT_WEBP_LOSSLESS, FRAME_HEADER_BYTES, type FrameHeader } from "../generated/proto";

/** A frame's header and its still encoded picture. */
export interface EncodedFrame {
  header: FrameHeader;
  payload: Blob;
}

const mediaTypes: Record<number, string> = {
  [FORMAT_JPEG]: "image/jpeg",
  [FORMAT_WEBP_LOSSLESS]: "image/webp",
};

/** Splits a binary message; null if it is not a whole frame of a known format. */
export function parseFrame(buffer: ArrayBuffer): EncodedFrame | null {
  const header = decodeFrameHeader(buffer);
  const type = header ? mediaTypes[header.format] : undefined;
  if (!header || type === undefined || buffer.byteLength !== FRAME_HEADER_BYTES + header.payload_bytes) return null;
  return { header, payload: new Blob([new Uint8Array(buffer, FRAME_HEADER_BYTES)], { type }) };
}

/** What a receiver needs from its surroundings. */
export interface FrameSink<Picture> {
  decode: (payload: Blob) => Promise<Picture>;
  /** Puts a decoded picture on screen. */
  show: (picture: Picture, header: FrameHeader) => void;
  acknowledge: (frame: number, decodeMillis: number) => void;
  /** A message that is no frame, or a picture that cannot be decoded. */
  damaged: (reason: string) => void;
  now: () => number;
}

export class FrameReceiver<Picture> {
  private waiting: EncodedFrame | null = null;
  private decoding = false;
  private closed = false;

  constructor(private readonly sink: FrameSink<Picture>) {}

  /** Takes a binary message. */
  receive(buffer: ArrayBuffer): void {
    const frame = parseFrame(buffer);
    if (!frame) {
      this.sink.damaged("The service sent a picture this page cannot read; reload the page to get the matching version.");
      return;
    }
    if (this.waiting) this.sink.acknowledge(this.waiting.header.frame, 0);
    this.waiting = frame;
    if (!this.decoding) void this.drain();
  }

  /** The connection is gone: what is still decoding is not shown and not acknowledged. */
  close(): void {
    this.closed = true;
    this.waiting = null;
  }

  private async drain(): Promise<void> {
    this.decoding = true;
    for (let frame = this.next(); frame; frame = this.next()) await this.showOne(frame);
    this.decoding = false;
  }

  private async showOne(frame: EncodedFrame): Promise<void> {
    const start = this.sink.now();
    try {
      const picture = await this.sink.decode(frame.payload);
      if (this.closed) return;
      this.sink.show(picture, frame.header);
    } catch {
      this.sink.damaged("A picture could not be decoded; the next one will replace it.");
    }
    if (!this.closed) this.sink.acknowledge(frame.header.frame, this.sink.now() - start);
  }

  private next(): EncodedFrame | null {
    const frame = this.waiting;
    this.waiting = null;
    return this.closed ? null : frame;
  }
}
