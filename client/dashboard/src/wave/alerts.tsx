// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { timeMs } from '../api/json_values';
import type { LiveAlert, LivePairNeed } from '../api/types';
import { Chip, Meter } from '../shell/parts';
import { span } from '../view/format';
import { alertMark } from './camera_tile';

const words: Record<string, string> = { bad: 'error', warn: 'warning', info: 'note' };

/** What a person should know now, worst first. `nowMs` is the server's time. */
export function Alerts({ alerts, nowMs, known }: {
  alerts: readonly LiveAlert[]; nowMs: number | undefined; known: boolean;
}): JSX.Element {
  // What was true a while ago would be read as true now.
  if (!known) return <ul class="alerts"><li class="none"><Chip mark="idle">Alerts are not known</Chip></li></ul>;
  return <ul class="alerts" aria-live="polite" aria-relevant="additions">
    {alerts.length === 0 && <li class="none"><Chip mark="good">No alerts</Chip></li>}
    {alerts.map((alert) => {
      const mark = alertMark(alert);
      const since = timeMs(alert.since);
      return <li key={`${alert.kind} ${alert.camera}`} class={mark}>
        <Chip mark={mark}>{words[mark]}</Chip> <span>{alert.text}</span>
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
