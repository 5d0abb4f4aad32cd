// SPDX-License-Identifier: Apache-2.0
// Nothing runs while nobody can see the page.

/** Another tab is in front, or the screen is off. */
export function isHidden(): boolean {
  return globalThis.document?.visibilityState === 'hidden';
}

/** Calls `change` when the page is hidden or shown; returns what ends that. */
export function onVisibility(change: () => void): () => void {
  globalThis.document?.addEventListener('visibilitychange', change);
  return () => globalThis.document?.removeEventListener('visibilitychange', change);
}

/** Calls `work` with this period while the page is visible, and at once when it is shown again; returns
 * what ends that. */
export function whileVisible(periodMs: number, work: () => void): () => void {
  let timer: ReturnType<typeof setInterval> | undefined;
  const begin = (): void => {
    clearInterval(timer);
    timer = isHidden() ? undefined : setInterval(work, periodMs);
  };
  const forget = onVisibility(() => {
    begin();
    if (!isHidden()) work();
  });
  begin();
  return () => {
    forget();
    clearInterval(timer);
  };
}
