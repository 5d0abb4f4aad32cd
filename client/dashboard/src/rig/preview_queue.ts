// SPDX-License-Identifier: Apache-2.0
// Previews cost network and, a little, the agents: at most two are under way, each camera is asked at
// most once a second, and only cameras that are visible on the screen. One that gives none rests for long.

import { isHidden, onVisibility } from '../shell/visible';

/** Loads a preview; resolves also where there is none. 'none': the camera gives none as things are. */
export type LoadPreview = () => Promise<'none' | void>;

interface Entry {
  load: LoadPreview;
  nextAt: number;
  busy: boolean;
}

/** One per page. */
export class PreviewQueue {
  private readonly entries = new Map<string, Entry>();
  private readonly restUntil = new Map<string, number>();
  private inFlight = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly limit = 2, private readonly periodMs = 1000,
    private readonly now: () => number = () => performance.now(), private readonly restMs = 60000) {
    onVisibility(this.pump);
  }

  /** A camera has become visible. One that rests goes on resting. */
  add(camera: string, load: LoadPreview): void {
    this.entries.set(camera, { load, nextAt: Math.max(this.now(), this.restUntil.get(camera) ?? 0), busy: false });
    this.pump();
  }

  /** Something about a camera has changed: it may give previews now. */
  wake(camera: string): void {
    this.restUntil.delete(camera);
    const entry = this.entries.get(camera);
    if (entry) entry.nextAt = Math.min(entry.nextAt, this.now());
    this.pump();
  }

  /** It is not visible any more. */
  remove(camera: string): void {
    this.entries.delete(camera);
    if (this.entries.size === 0) clearTimeout(this.timer);
  }

  private readonly pump = (): void => {
    clearTimeout(this.timer);
    if (isHidden()) return;
    const now = this.now();
    // The camera that has waited longest is next.
    const waiting = [...this.entries].filter(([, entry]) => !entry.busy).sort(([, a], [, b]) => a.nextAt - b.nextAt);
    for (const [camera, entry] of waiting) {
      if (this.inFlight >= this.limit || entry.nextAt > now) break;
      void this.run(camera, entry);
    }
    const next = waiting.find(([, entry]) => !entry.busy)?.[1];
    if (next && this.inFlight < this.limit) this.timer = setTimeout(this.pump, Math.max(10, next.nextAt - now));
  };

  private async run(camera: string, entry: Entry): Promise<void> {
    entry.busy = true;
    this.inFlight += 1;
    const began = this.now();
    let pause = this.periodMs;
    try {
      if (await entry.load() === 'none') {
        pause = this.restMs;
        this.restUntil.set(camera, began + pause);
      }
    } catch {
      // It is asked for again.
    } finally {
      this.inFlight -= 1;
      entry.busy = false;
      entry.nextAt = began + pause;
      this.pump();
    }
  }
}
