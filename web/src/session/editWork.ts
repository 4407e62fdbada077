/**
 * What became of the newest edit: when its first picture, its whole light and its final picture were on
 * screen, and how much of what is kept was reused and redone for it.
 */

import { FLAG_FINAL, type FrameHeader, type FrameReport } from "../generated/proto";

/** Counters of what is kept between edits. The first two tell of all there is, with every report; segments where they are cast. */
const KINDS = [
  { name: "photons", redone: "photons_recomputed", reused: "photons_reused", ofAll: true },
  { name: "bricks", redone: "bricks_recomputed", reused: "bricks_reused", ofAll: true },
  { name: "tiles", redone: "tiles_recomputed", reused: "tiles_reused", ofAll: true },
  { name: "segments", redone: "segments_cast", reused: "segments_reused", ofAll: false },
] as const;
/** Pictures whose input numbers are remembered for the reports that follow them. */
const MAX_FRAMES = 16;

export interface KindOfWork {
  name: string;
  redone: number;
  reused: number;
}

export interface EditWork {
  /** Number of the input. */
  seq: number;
  /** From sending it to the screen, milliseconds; null as long as it is not there. */
  firstMillis: number | null;
  litMillis: number | null;
  finalMillis: number | null;
  /** Share of the light that is of the scene in the newest picture, 0..1. */
  completeness: number;
  kinds: readonly KindOfWork[];
}

export class EditMeter {
  private work: EditWork | null = null;
  private sentAt = 0;
  private frames: { frame: number; seq: number }[] = [];

  /** The edit `seq` was sent at `now` (milliseconds). */
  sent(seq: number, now: number): void {
    this.sentAt = now;
    this.work = { seq, firstMillis: null, litMillis: null, finalMillis: null, completeness: 0, kinds: [] };
  }

  /** A picture arrived, shown or not. */
  arrived({ frame, seq }: Pick<FrameHeader, "frame" | "seq">): void {
    this.frames = [...this.frames, { frame, seq }].slice(-MAX_FRAMES);
  }

  /** A picture came on screen. */
  shown({ seq, flags, illumination_completeness: completeness }: Pick<FrameHeader, "seq" | "flags" | "illumination_completeness">, now: number): void {
    if (!this.work || seq < this.work.seq) return;
    const after = now - this.sentAt;
    const { firstMillis, litMillis, finalMillis } = this.work;
    this.work = {
      ...this.work,
      completeness,
      firstMillis: firstMillis ?? after,
      litMillis: litMillis ?? (completeness >= 1 ? after : null),
      finalMillis: finalMillis ?? (flags & FLAG_FINAL ? after : null),
    };
  }

  /** What was done for a picture that arrived. Once the edit is final, nothing more is done for it. */
  reported(frame: number, { counters }: Pick<FrameReport, "counters">): void {
    const seq = this.frames.find((known) => known.frame === frame)?.seq;
    const { work } = this;
    if (!work || seq === undefined || seq < work.seq) return;
    const kinds = KINDS.flatMap(({ name, redone, reused, ofAll }): KindOfWork[] => {
      const before = work.kinds.find((kind) => kind.name === name);
      const [again, kept] = [counters[redone], counters[reused]];
      if (again === undefined || kept === undefined || again + kept === 0) return before ? [before] : [];
      const sum = (before?.redone ?? 0) + again;
      if (!ofAll) return [{ name, redone: sum, reused: (before?.reused ?? 0) + kept }];
      const all = Math.max(again + kept, before ? before.redone + before.reused : 0);
      return [{ name, redone: sum, reused: Math.max(0, all - sum) }];
    });
    this.work = { ...work, kinds };
  }

  /** The connection is gone: numbers begin again. */
  forget(): void {
    this.work = null;
    this.frames = [];
  }

  read(): EditWork | null {
    return this.work;
  }
}
