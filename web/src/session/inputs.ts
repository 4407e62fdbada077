/** What goes to the server: numbered, newest state only, at most once per animation frame. */

import type { Camera, ClientMessage } from "../generated/proto";
import type { SceneSync } from "./sync";

/** Inputs of a hidden page are sent this often, milliseconds: it gets no animation frames. */
const HIDDEN_FLUSH_MILLIS = 100;

export interface ViewportSize {
  /** CSS pixels. */
  width: number;
  height: number;
  /** Device pixels per CSS pixel. */
  pixel_ratio: number;
}

/** What inputs need from their surroundings. */
export interface InputSink {
  /** The scene to take edits and camera from; null while nothing may be sent. */
  scene: () => SceneSync | null;
  send: (message: ClientMessage) => void;
  /** An input was numbered and is about to be sent. */
  numbered: (seq: number) => void;
  /** Input `seq` is this camera. */
  cameraSent: (seq: number, camera: Camera) => void;
}

export class Inputs {
  private seq = 0;
  private pending = false;
  private cameraMoved = false;
  private viewportChanged = false;
  private size: ViewportSize | null = null;

  constructor(private readonly sink: InputSink) {}

  get viewport(): ViewportSize | null {
    return this.size;
  }

  resize(size: ViewportSize): void {
    const old = this.size;
    if (old?.width === size.width && old.height === size.height && old.pixel_ratio === size.pixel_ratio) return;
    this.size = size;
    this.viewportChanged = true;
    this.schedule();
  }

  moveCamera(): void {
    this.cameraMoved = true;
    this.schedule();
  }

  /** A new connection knows nothing of this viewer: everything is sent again. */
  repeat(): void {
    this.cameraMoved = true;
    this.viewportChanged = true;
    this.flush();
  }

  /** Sends with the next animation frame what has changed until then. */
  schedule(): void {
    if (this.pending) return;
    this.pending = true;
    const flush = () => {
      this.pending = false;
      this.flush();
    };
    if (document.hidden) window.setTimeout(flush, HIDDEN_FLUSH_MILLIS);
    else window.requestAnimationFrame(flush);
  }

  private flush(): void {
    const sync = this.sink.scene();
    if (!sync) return;
    if (this.viewportChanged && this.size) {
      this.viewportChanged = false;
      this.sink.send({ type: "viewport", seq: this.next(), ...this.size });
    }
    for (const { seq, patch } of sync.takeUnsent(() => this.next())) this.sink.send({ type: "patch", seq, patch });
    const { camera } = sync.scene;
    if (this.cameraMoved && camera) {
      this.cameraMoved = false;
      const seq = this.next();
      this.sink.cameraSent(seq, camera);
      this.sink.send({ type: "camera", seq, camera });
    }
  }

  private next(): number {
    this.seq += 1;
    this.sink.numbered(this.seq);
    return this.seq;
  }
}
