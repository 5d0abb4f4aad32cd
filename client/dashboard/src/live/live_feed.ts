// SPDX-License-Identifier: Apache-2.0
// Polls the live state and the status of the server, and says how old they are.
import { ApiError, errorText, getLive, getStatus } from '../api/server_api';
import type { GetStatusResponse } from '../api/types';
import { isHidden, onVisibility, whileVisible } from '../shell/visible';
import { backoffMs } from './backoff';
import { emptyRigState, mergeLive, type RigState } from './live_merge';

/** Data older than this are not shown as if they were current. */
export const staleAfterMs = 2500;

/** What the pages show. A new object after each change. */
export interface FeedState {
  rig: RigState;
  status: GetStatusResponse | undefined;
  /** performance.now() of the last answer; undefined: none yet. */
  answeredAt: number | undefined;
  /** The last answer is too old. */
  stale: boolean;
  /** Why there is no answer. Empty: there is. */
  problem: string;
  /** The server wants a login. */
  needsLogin: boolean;
  /** When the server was found to have been restarted, ms since 1970. */
  restartedAt: number | undefined;
}

/** Period of polling by how much somebody looks at it, ms. */
export type Attention = 'wave' | 'other';
const periodMs: Record<Attention, number> = { wave: 250, other: 1000 };
const statusPeriodMs = 5000;

/** One feed per page. */
export class LiveFeed {
  private current: FeedState = {
    rig: emptyRigState, status: undefined, answeredAt: undefined, stale: false, problem: '',
    needsLogin: false, restartedAt: undefined,
  };
  private readonly listeners = new Set<() => void>();
  private readonly control = { stopped: true, rig: '', attention: 'wave' as Attention };
  private etag: string | undefined;
  private failures = 0;
  private anew = false;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private endAgeTimer = (): void => {};
  private forgetVisibility = (): void => {};
  private abort: AbortController | undefined;
  private statusAt = -Infinity;
  private startedAt = 0;

  get state(): FeedState {
    return this.current;
  }

  subscribe(listener: () => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  start(rig: string): void {
    this.control.stopped = false;
    this.control.rig = rig;
    this.startedAt = performance.now();
    this.endAgeTimer = whileVisible(500, () => this.checkAge());
    globalThis.addEventListener?.('online', this.retryNow);
    this.forgetVisibility = onVisibility(this.retryNow);
    this.schedule(0);
  }

  stop(): void {
    this.control.stopped = true;
    clearTimeout(this.timer);
    this.endAgeTimer();
    this.abort?.abort();
    globalThis.removeEventListener?.('online', this.retryNow);
    this.forgetVisibility();
  }

  /** Another rig: everything is asked for anew. */
  setRig(rig: string): void {
    if (rig === this.control.rig) return;
    this.control.rig = rig;
    this.etag = undefined;
    this.abort?.abort();
    this.publish({ rig: emptyRigState });
    this.schedule(0);
  }

  /** Asks for everything: what is gone, such as a deleted session, no delta can say. */
  askAnew(): void {
    this.anew = true;
    this.retryNow();
  }

  /** How often to ask. */
  setAttention(attention: Attention): void {
    if (this.control.attention === attention) return;
    this.control.attention = attention;
    this.retryNow();
  }

  /** Asks now instead of at the end of the wait; after a login or a click. */
  readonly retryNow = (): void => {
    if (this.control.stopped || this.abort) return;
    this.schedule(0);
  };

  /** Milliseconds since the last answer, or since the start where there was none. */
  ageMs(): number {
    return performance.now() - (this.current.answeredAt ?? this.startedAt);
  }

  private publish(change: Partial<FeedState>): void {
    this.current = { ...this.current, ...change };
    for (const listener of this.listeners) listener();
  }

  private checkAge(): void {
    const stale = this.ageMs() > staleAfterMs;
    // While the data are old their age is shown, and changes.
    if (stale || stale !== this.current.stale) this.publish({ stale });
  }

  private schedule(delayMs: number): void {
    clearTimeout(this.timer);
    // While the page is hidden nothing is asked; shown again, at once.
    if (!this.control.stopped && !isHidden()) this.timer = setTimeout(() => void this.poll(), delayMs);
  }

  private async poll(): Promise<void> {
    if (this.abort) return;
    const began = performance.now();
    const abort = new AbortController();
    this.abort = abort;
    const rig = this.control.rig;
    try {
      const anew = this.anew;
      const answer = await getLive(rig, anew ? '' : this.current.rig.revision, anew ? undefined : this.etag, abort.signal);
      if (abort.signal.aborted) return;
      if (anew) this.anew = false;
      this.etag = answer.etag;
      const merged = answer.live ? mergeLive(this.current.rig, answer.live) : this.current.rig;
      const returned = this.failures > 0;
      this.failures = 0;
      if (returned || performance.now() - this.statusAt > statusPeriodMs) await this.readStatus(abort.signal);
      if (abort.signal.aborted) return;
      const quiet = merged === this.current.rig && this.current.problem === '' && !this.current.stale;
      if (quiet) this.current.answeredAt = performance.now();
      else {
        this.publish({ rig: merged, answeredAt: performance.now(), stale: false, problem: '', needsLogin: false });
      }
    } catch (error) {
      if (!abort.signal.aborted) this.fail(error);
    } finally {
      if (this.abort === abort) this.abort = undefined;
      const period = periodMs[this.control.attention];
      const wait = this.failures > 0 ? backoffMs(this.failures, Math.random())
        : Math.max(20, period - (performance.now() - began));
      this.schedule(rig === this.control.rig ? wait : 0);
    }
  }

  private fail(error: unknown): void {
    this.failures += 1;
    const needsLogin = error instanceof ApiError && error.needsLogin;
    this.publish({ problem: errorText(error), needsLogin, stale: this.ageMs() > staleAfterMs });
  }

  private async readStatus(signal: AbortSignal): Promise<void> {
    const status = await getStatus(signal);
    this.statusAt = performance.now();
    const before = this.current.status;
    const restarted = before?.start_time !== undefined && before.start_time !== status.start_time;
    this.publish({ status, ...(restarted ? { restartedAt: Date.now() } : {}) });
  }

  /** The person has read that the server was restarted. */
  dismissRestart(): void {
    this.publish({ restartedAt: undefined });
  }
}
