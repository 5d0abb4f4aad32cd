// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { timeMs } from '../api/json_values';
import type { LiveAlert, LivePairNeed } from '../api/types';
import { Chip, Meter } from '../shell/parts';
import { span } from '../view/format';
import { alertMark } from './camera_tile';

/** With more alerts than this, those of one kind are one. */
const mostAlone = 8;
/** So many cameras are named of a group. */
const mostNamed = 6;

/** Alerts of one kind and severity. */
export interface AlertGroup {
  first: LiveAlert;
  cameras: string[];
}

/** Each alert alone; of many, those of one kind together, in the order of the first of each. */
export function groupAlerts(alerts: readonly LiveAlert[]): AlertGroup[] {
  const groups = new Map<string, AlertGroup>();
  for (const alert of alerts) {
    const key = alerts.length > mostAlone && alert.camera ? `${alert.severity} ${alert.kind}` : `${alert.kind} ${alert.camera}`;
    const group = groups.get(key);
    if (group) group.cameras.push(alert.camera ?? '');
    else groups.set(key, { first: alert, cameras: [alert.camera ?? ''] });
  }
  return [...groups.values()];
}

/** "2 more: a, b"; '' for one alone. */
function othersText({ cameras }: AlertGroup): string {
  const others = cameras.slice(1);
  if (others.length === 0) return '';
  return ` And ${others.length} more: ${others.slice(0, mostNamed).join(', ')}${others.length > mostNamed ? ', …' : ''}`;
}

const words: Record<string, string> = { bad: 'error', warn: 'warning', info: 'note' };

/** What a person should know now, worst first. `nowMs` is the server's time. */
export function Alerts({ alerts, nowMs, known }: {
  alerts: readonly LiveAlert[]; nowMs: number | undefined; known: boolean;
}): JSX.Element {
  // What was true a while ago would be read as true now.
  if (!known) return <ul class="alerts"><li class="none"><Chip mark="idle">Alerts are not known</Chip></li></ul>;
  return <ul class="alerts" aria-live="polite" aria-relevant="additions">
    {alerts.length === 0 && <li class="none"><Chip mark="good">No alerts</Chip></li>}
    {groupAlerts(alerts).map((group) => {
      const alert = group.first;
      const mark = alertMark(alert);
      const since = timeMs(alert.since);
      return <li key={`${alert.kind} ${alert.camera}`} class={mark}>
        <Chip mark={mark}>{group.cameras.length > 1 ? `${group.cameras.length} cameras` : words[mark]}</Chip> <span>{alert.text}{othersText(group)}</span>
        {since !== undefined && nowMs !== undefined && <span class="since" aria-hidden="true">{span((nowMs - since) / 1000)}</span>}
      </li>;
    })}
  </ul>;
}

/** Pairs of cameras that must see more together before a solution is possible. */
export function PairNeeds({ needs }: { needs: readonly LivePairNeed[] }): JSX.Element {
  return <ol class="needs">{needs.slice(0, 6).map((need) => {
    const [now, wanted] = [need.common_count ?? 0, need.needed_count ?? 0];
    return <li key={`${need.camera_a} ${need.camera_b}`}>
      <span>Wave where <b>{need.camera_a}</b> and <b>{need.camera_b}</b> both see it</span>
      <Meter share={wanted > 0 ? now / wanted : 0} label={`${need.camera_a} and ${need.camera_b}`} />
      <span class="numbers">{now}/{wanted}</span></li>;
  })}{needs.length > 6 && <li>and {needs.length - 6} more pairs</li>}</ol>;
}
