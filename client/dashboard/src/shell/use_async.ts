// SPDX-License-Identifier: Apache-2.0
import { useCallback, useEffect, useRef, useState } from 'preact/hooks';
import { errorText } from '../api/server_api';
import { isHidden, onVisibility } from './visible';

/** What a call has given so far. */
export interface Loaded<T> {
  value: T | undefined;
  problem: string;
  loading: boolean;
  reload: () => void;
}

/** Calls `load` at first, when `key` changes and, with a period, again and again while the page is
 * visible. The last value stays while the next one loads. */
export function useLoaded<T>(key: string, load: (signal: AbortSignal) => Promise<T>, periodMs = 0): Loaded<T> {
  const [result, setResult] = useState<{ key: string; value: T | undefined; problem: string; loading: boolean }>(
    { key, value: undefined, problem: '', loading: true });
  const [turn, setTurn] = useState(0);
  const latest = useRef(load);
  latest.current = load;
  useEffect(() => {
    const abort = new AbortController();
    let timer: ReturnType<typeof setTimeout> | undefined;
    // The page was hidden when it was time to load again.
    let due = false;
    const run = async (): Promise<void> => {
      try {
        const value = await latest.current(abort.signal);
        if (!abort.signal.aborted) setResult({ key, value, problem: '', loading: false });
      } catch (error) {
        if (!abort.signal.aborted) {
          setResult((old) => ({ key, value: old.key === key ? old.value : undefined,
            problem: errorText(error), loading: false }));
        }
      }
      due = periodMs > 0 && isHidden();
      if (!abort.signal.aborted && periodMs > 0 && !due) timer = setTimeout(() => void run(), periodMs);
    };
    const forget = onVisibility(() => {
      if (!due || isHidden()) return;
      due = false;
      void run();
    });
    void run();
    return () => {
      forget();
      abort.abort();
      clearTimeout(timer);
    };
  }, [key, turn, periodMs]);
  const reload = useCallback(() => setTurn((value) => value + 1), []);
  const fresh = result.key === key;
  return { value: fresh ? result.value : undefined, problem: fresh ? result.problem : '',
    loading: fresh ? result.loading : true, reload };
}
