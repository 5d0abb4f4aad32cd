// SPDX-License-Identifier: Apache-2.0
// The live state as it is known here, and what an answer of the server makes of it.
import type {
  LiveAgent, LiveAlert, LiveCamera, LiveEstimate, LiveGoal, LiveOverlap, LiveState, Session,
} from '../api/types';

/** Everything that is known of the rig. Parts that did not change keep their identity. */
export interface RigState {
  revision: string;
  /** When the server made it, RFC 3339. */
  time: string | undefined;
  rig: string;
  session: Session | undefined;
  /** Sorted by name. */
  cameras: readonly LiveCamera[];
  overlap: LiveOverlap | undefined;
  estimate: LiveEstimate | undefined;
  alerts: readonly LiveAlert[];
  agents: readonly LiveAgent[];
  goal: LiveGoal | undefined;
  /** Seconds from the commit of the newest observation to this state. */
  ageS: number;
}

/** Nothing is known. */
export const emptyRigState: RigState = {
  revision: '', time: undefined, rig: '', session: undefined, cameras: [], overlap: undefined,
  estimate: undefined, alerts: [], agents: [], goal: undefined, ageS: 0,
};

const nameOf = (camera: LiveCamera): string => camera.camera ?? '';

function mergeCameras(before: readonly LiveCamera[], changed: readonly LiveCamera[] | undefined,
  removed: readonly string[] | undefined): readonly LiveCamera[] {
  if (!changed?.length && !removed?.length) return before;
  const all = new Map(before.map((camera) => [nameOf(camera), camera]));
  for (const name of removed ?? []) all.delete(name);
  for (const camera of changed ?? []) all.set(nameOf(camera), camera);
  return [...all.values()].sort((a, b) => (nameOf(a) < nameOf(b) ? -1 : 1));
}

/** The state after an answer. An answer that names the known revision changes nothing. */
export function mergeLive(before: RigState, answer: LiveState): RigState {
  const revision = answer.revision ?? '';
  if (!answer.full && revision !== '' && revision === before.revision) return before;
  const base = answer.full ? emptyRigState : before;
  // A delta has no other way to say that the goal is gone than a session without one.
  const keepsGoal = answer.session === undefined || answer.session.goal !== undefined;
  return {
    revision,
    time: answer.time ?? base.time,
    rig: answer.rig ?? base.rig,
    session: answer.session ?? base.session,
    cameras: mergeCameras(base.cameras, answer.cameras, answer.removed_cameras),
    overlap: answer.overlap ?? base.overlap,
    estimate: answer.estimate ?? base.estimate,
    alerts: answer.alerts ? (answer.alerts.alerts ?? []) : base.alerts,
    agents: answer.agents ? (answer.agents.agents ?? []) : base.agents,
    goal: answer.goal ?? (keepsGoal ? base.goal : undefined),
    ageS: answer.age_s ?? 0,
  };
}
