// SPDX-License-Identifier: Apache-2.0
// Which cameras of a large rig need something, and which of them a person looks for.
import { toCount } from '../api/json_values';
import type { LiveAlert, LiveCamera } from '../api/types';
import type { Mark } from '../shell/parts';
import { count } from '../view/format';

/** So many cameras are shown one by one, with all that is known of them. */
export const fewCameras = 16;

/** A camera and what it needs. */
export interface CameraNeed {
  camera: LiveCamera;
  name: string;
  mark: Mark;
  /** What is wrong; '': nothing. */
  why: string;
}

const urgency: Record<Mark, number> = { bad: 0, warn: 1, info: 2, idle: 3, live: 3, good: 3 };
const severities: Record<string, Mark> = { SEVERITY_ERROR: 'bad', SEVERITY_WARNING: 'warn' };

/** Its worst alert, else a state or a loss that no alert has named. */
function needOf(camera: LiveCamera, alert: LiveAlert | undefined): CameraNeed {
  const name = camera.camera ?? '';
  if (alert) return { camera, name, mark: severities[alert.severity ?? ''] ?? 'info', why: alert.text ?? '' };
  if (camera.state === 'STATE_OFFLINE') return { camera, name, mark: 'bad', why: 'Its agent is not connected.' };
  const lost = toCount(camera.dropped_count);
  if (lost > 0) return { camera, name, mark: 'warn', why: `${count(lost)} of its observations are lost or were refused.` };
  const mark = camera.state === 'STATE_CAPTURING' ? 'live' : camera.state === 'STATE_ENDED' ? 'good' : 'idle';
  return { camera, name, mark, why: '' };
}

/** How much of what is wanted of it the camera has seen together with others; 1 where nothing is wanted. */
function sharedPart(camera: LiveCamera): number {
  const goal = camera.shared_instant_goal ?? 0;
  return goal > 0 ? Math.min(1, (camera.shared_instant_count ?? 0) / goal) : 1;
}

/** All cameras: errors, warnings, notes, then those that have seen least together with others; else by name. `alerts` are worst first. */
export function needsOf(cameras: readonly LiveCamera[], alerts: readonly LiveAlert[]): CameraNeed[] {
  const worst = new Map<string, LiveAlert>();
  for (const alert of alerts) if (alert.camera && !worst.has(alert.camera)) worst.set(alert.camera, alert);
  return cameras.map((camera) => needOf(camera, worst.get(camera.camera ?? '')))
    .sort((a, b) => urgency[a.mark] - urgency[b.mark] || sharedPart(a.camera) - sharedPart(b.camera)
      || a.name.localeCompare(b.name, 'en', { numeric: true }));
}

/** Whether a person must do something about it: an error or a warning. */
export function needsSomething(need: CameraNeed): boolean {
  return need.mark === 'bad' || need.mark === 'warn';
}

/** Those in whose name, agent or need every word of `text` is. */
export function matching(needs: readonly CameraNeed[], text: string): CameraNeed[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return needs.filter((need) => {
    const all = `${need.name} ${need.camera.agent_id ?? ''} ${need.why}`.toLowerCase();
    return words.every((word) => all.includes(word));
  });
}

/** "488 good, 12 need something". */
export function needsText(needs: readonly CameraNeed[]): string {
  const wanting = needs.filter(needsSomething).length;
  return wanting === 0 ? `all ${needs.length} good` : `${needs.length - wanting} good, ${wanting} need${wanting === 1 ? 's' : ''} something`;
}
