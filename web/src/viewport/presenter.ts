/** Puts pictures on the canvas, stretched to its device pixels. The last one stays until the next. */

import type { FrameHeader } from "../generated/proto";

/** Relative difference of aspect above which a picture is for another viewport size. */
const ASPECT_TOLERANCE = 0.02;

export class Presenter {
  private readonly context: CanvasRenderingContext2D | null;
  private picture: ImageBitmap | null = null;
  private header: FrameHeader | null = null;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.context = canvas.getContext("2d", { alpha: false });
  }

  show(picture: ImageBitmap, header: FrameHeader): void {
    this.picture?.close();
    this.picture = picture;
    this.header = header;
    this.draw();
    const { dataset } = this.canvas;
    dataset.frame = String(header.frame);
    dataset.seq = String(header.seq);
    dataset.epoch = String(header.snapshot_epoch);
    dataset.size = `${header.width}x${header.height}`;
  }

  /** The canvas has `width` x `height` device pixels from now on. */
  resize(width: number, height: number): void {
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.draw();
  }

  /** What is on the canvas, as PNG. */
  still(): Promise<Blob> {
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("The browser could not write the picture."))), "image/png");
    });
  }

  private draw(): void {
    const { canvas, context, picture, header } = this;
    if (!context || !picture || !header) return;
    context.imageSmoothingEnabled = picture.width !== canvas.width || picture.height !== canvas.height;
    context.imageSmoothingQuality = "high";
    const pictureAspect = header.viewport_width / header.viewport_height;
    const canvasAspect = canvas.width / canvas.height;
    if (Math.abs(pictureAspect / canvasAspect - 1) < ASPECT_TOLERANCE) {
      context.drawImage(picture, 0, 0, canvas.width, canvas.height);
      return;
    }
    // The viewport has changed shape and the picture for it is still to come: the angle of view is
    // vertical, so the same height shows every thing at its place.
    const width = canvas.height * pictureAspect;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(picture, (canvas.width - width) / 2, 0, width, canvas.height);
  }
}
