// SPDX-License-Identifier: Apache-2.0
// Previews cost network and, a little, the agents: at most two are under way, each camera is asked at
// most once a second, and only cameras that are visible on the screen.

import { isHidden, onVisibility } from '../shell/visible';

/** Loads a preview; resolves also where there is none. */
export type LoadPreview = () => Promise<void>;

interface Entry {
  load: LoadPreview;
  nextAt: number;
  busy: boolean;
}

/** One per page. */
export class PreviewQueue {
  private readonly entries = new Map<string, Entry>();
  private inFlight = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly limit = 2, private readonly periodMs = 1000,
    private readonly now: () => number = () => performance.now()) {
    onVisibility(this.pump);
  }

  /** A camera has become visible. */
  add(camera: string, load: LoadPreview): void {
    this.entries.set(camera, { load, nextAt: this.now(), busy: false });
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
    const waiting = [...this.entries.values()].filter((entry) => !entry.busy).sort((a, b) => a.nextAt - b.nextAt);
    for (const entry of waiting) {
      if (this.inFlight >= this.limit || entry.nextAt > now) break;
      void this.run(entry);
    }
    const next = waiting.find((entry) => !entry.busy);
    if (next && this.inFlight < this.limit) this.timer = setTimeout(this.pump, Math.max(10, next.nextAt - now));
  };

  private async run(entry: Entry): Promise<void> {
    entry.busy = true;
    this.inFlight += 1;
    const began = this.now();
    try {
      await entry.load();
    } catch {
      // It is asked for again.
    } finally {
      this.inFlight -= 1;
      entry.busy = false;
      entry.nextAt = began + this.periodMs;
      this.pump();
    }
  }
}
