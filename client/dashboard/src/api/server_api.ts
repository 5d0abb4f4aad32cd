// SPDX-License-Identifier: Apache-2.0
// Calls of the JSON API of the page's own server.
import type {
  ActivateCalibrationResponse, Activation, Calibration, CalibrationOptions, ColourRange, CreateCalibrationResponse, CreateSessionRequest,
  CreateSessionResponse, CreateTokenRequest, CreateTokenResponse, Detector, DiscardSessionResponse,
  GetAccuracyResponse, GetCalibrationResponse, GetDetectorResponse, GetLensResponse, GetLiveResponse, GetResidualsResponse,
  GetSessionResponse, GetStatusResponse, ListActivationsResponse, ListAgentsResponse, ListCalibrationsResponse,
  ListExportsResponse, Lens, ListRigsResponse, ListSessionsResponse, LiveState, RollbackRigResponse, Session,
  StartSessionResponse, StopSessionResponse,
} from './types';

/** A refusal by the server, or no answer. `code` is the gRPC name: "FAILED_PRECONDITION". */
export class ApiError extends Error {
  constructor(readonly code: string, message: string, readonly httpStatus: number) {
    super(message);
    this.name = 'ApiError';
  }

  /** The server wants to know who asks. */
  get needsLogin(): boolean {
    return this.httpStatus === 401 || this.code === 'UNAUTHENTICATED';
  }
}

/** Text of anything thrown, for a person. */
export function errorText(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

interface CallOptions {
  method?: 'GET' | 'POST' | 'DELETE';
  body?: unknown;
  signal?: AbortSignal;
  /** Milliseconds until the call is given up. */
  timeoutMs?: number;
  etag?: string;
  /** The answer is a file: `json` is a Blob. */
  binary?: boolean;
}

interface Answer {
  status: number;
  etag: string | undefined;
  json: unknown;
}

async function call(path: string, options: CallOptions = {}): Promise<Answer> {
  const controller = new AbortController();
  const timer = setTimeout(() => controller.abort(), options.timeoutMs ?? 15000);
  const give_up = () => controller.abort();
  options.signal?.addEventListener('abort', give_up, { once: true });
  const headers: Record<string, string> = { Accept: options.binary ? 'image/*, application/json' : 'application/json' };
  const method = options.method ?? 'GET';
  if (method !== 'GET') headers['X-Rigcal'] = '1';
  if (options.body !== undefined) headers['Content-Type'] = 'application/json';
  if (options.etag) headers['If-None-Match'] = options.etag;
  try {
    const response = await fetch(path, {
      method, headers, signal: controller.signal, cache: 'no-store', credentials: 'same-origin',
      body: options.body === undefined ? undefined : JSON.stringify(options.body),
    });
    const etag = response.headers.get('ETag') ?? undefined;
    if (response.status === 304) return { status: 304, etag: etag ?? options.etag, json: undefined };
    if (options.binary && response.ok) return { status: response.status, etag, json: await response.blob() };
    const text = await response.text();
    let json: unknown = {};
    if (text !== '') {
      try {
        json = JSON.parse(text);
      } catch {
        if (response.ok) throw new ApiError('INTERNAL', `${path}: the answer is not JSON`, response.status);
      }
    }
    if (!response.ok) {
      const refusal = json as { code?: unknown; message?: unknown };
      throw new ApiError(typeof refusal.code === 'string' ? refusal.code : `HTTP_${response.status}`,
        typeof refusal.message === 'string' && refusal.message !== '' ? refusal.message
          : `the server answered ${response.status} to ${path}`, response.status);
    }
    return { status: response.status, etag, json };
  } catch (error) {
    if (error instanceof ApiError) throw error;
    if (options.signal?.aborted) throw error;
    throw new ApiError('UNAVAILABLE', controller.signal.aborted
      ? 'The server does not answer in time.' : 'The server cannot be reached.', 0);
  } finally {
    clearTimeout(timer);
    options.signal?.removeEventListener('abort', give_up);
  }
}

async function ask<T>(path: string, options: CallOptions = {}): Promise<T> {
  return (await call(path, options)).json as T;
}

function query(fields: Record<string, string | number | undefined>): string {
  const parts = new URLSearchParams();
  for (const [name, value] of Object.entries(fields)) {
    if (value !== undefined && value !== '' && value !== 0) parts.set(name, String(value));
  }
  const text = parts.toString();
  return text === '' ? '' : `?${text}`;
}

const part = encodeURIComponent;

/** An answer of `live`; `live` is undefined where nothing has changed (HTTP 304). */
export interface LiveAnswer {
  live: LiveState | undefined;
  etag: string | undefined;
}

/** The live state of a rig since a revision ("": all of it). */
export async function getLive(rig: string, sinceRevision: string, etag: string | undefined,
  signal?: AbortSignal): Promise<LiveAnswer> {
  const answer = await call(`/v1/live${query({ rig, since_revision: sinceRevision })}`,
    { etag, signal, timeoutMs: 5000 });
  if (answer.status === 304) return { live: undefined, etag: answer.etag };
  return { live: (answer.json as GetLiveResponse).live ?? {}, etag: answer.etag };
}

/** Version, load and health of the server. */
export function getStatus(signal?: AbortSignal): Promise<GetStatusResponse> {
  return ask('/v1/status', { signal, timeoutMs: 5000 });
}

/** Which part of a list. */
export interface ListOptions {
  filter?: string;
  order_by?: string;
  page_size?: number;
  page_token?: string;
}

/** A page of the sessions. */
export function listSessions(options: ListOptions = {}, signal?: AbortSignal): Promise<ListSessionsResponse> {
  return ask(`/v1/sessions${query({ ...options })}`, { signal });
}

/** One session with its cameras. */
export async function getSession(id: string, signal?: AbortSignal): Promise<Session> {
  return (await ask<GetSessionResponse>(`/v1/sessions/${part(id)}`, { signal })).session ?? {};
}

/** Creates a session. */
export async function createSession(request: CreateSessionRequest): Promise<Session> {
  return (await ask<CreateSessionResponse>('/v1/sessions', { method: 'POST', body: request })).session ?? {};
}

/** Starts a session. */
export async function startSession(id: string): Promise<Session> {
  return (await ask<StartSessionResponse>(`/v1/sessions/${part(id)}:start`, { method: 'POST', body: {} }))
    .session ?? {};
}

/** Stops a session. */
export async function stopSession(id: string): Promise<Session> {
  return (await ask<StopSessionResponse>(`/v1/sessions/${part(id)}:stop`, { method: 'POST', body: {} }))
    .session ?? {};
}

/** Marks a session as thrown away, or takes that back; nothing is deleted. */
export async function discardSession(id: string, undo = false): Promise<Session> {
  return (await ask<DiscardSessionResponse>(`/v1/sessions/${part(id)}:discard`, { method: 'POST', body: { undo } }))
    .session ?? {};
}

/** Starts a session that goes on with a finished one: same target, same cameras, until somebody stops it. */
export async function resumeSession(id: string): Promise<Session> {
  const before = await getSession(id);
  const session = await createSession({ rig: before.rig, title: before.title || undefined, target: before.target,
    camera_names: before.requested_cameras, continues: id });
  return startSession(session.id ?? '');
}

/** Deletes a session and its observations. */
export async function deleteSession(id: string): Promise<void> {
  await call(`/v1/sessions/${part(id)}`, { method: 'DELETE' });
}

/** The lens of a camera from the board that a session has seen, as far as it is known. */
export async function getLens(sessionId: string, camera: string, signal?: AbortSignal): Promise<Lens> {
  return (await ask<GetLensResponse>(`/v1/sessions/${part(sessionId)}/lenses/${part(camera)}`, { signal })).lens ?? {};
}

/** A page of the calibrations. */
export function listCalibrations(options: ListOptions = {}, signal?: AbortSignal):
  Promise<ListCalibrationsResponse> {
  return ask(`/v1/calibrations${query({ ...options })}`, { signal });
}

/** One calibration. */
export async function getCalibration(id: string, signal?: AbortSignal): Promise<Calibration> {
  return (await ask<GetCalibrationResponse>(`/v1/calibrations/${part(id)}`, { signal })).calibration ?? {};
}

/** Queues a calibration. */
export async function createCalibration(sessionIds: string[], options?: CalibrationOptions, reason = ''):
  Promise<Calibration> {
  const body = { session_ids: sessionIds, ...(options ? { options } : {}), ...(reason ? { reason } : {}) };
  return (await ask<CreateCalibrationResponse>('/v1/calibrations', { method: 'POST', body })).calibration ?? {};
}

/** Stops a queued or running calibration. */
export async function cancelCalibration(id: string): Promise<void> {
  await call(`/v1/calibrations/${part(id)}:cancel`, { method: 'POST', body: {} });
}

/** Deletes a calibration. */
export async function deleteCalibration(id: string): Promise<void> {
  await call(`/v1/calibrations/${part(id)}`, { method: 'DELETE' });
}

/** Expected errors over the waved volume. */
export function getAccuracy(id: string, signal?: AbortSignal): Promise<GetAccuracyResponse> {
  return ask(`/v1/calibrations/${part(id)}/accuracy`, { signal });
}

/** Residual vectors over the image and their histogram, camera by camera. */
export function getResiduals(id: string, signal?: AbortSignal): Promise<GetResidualsResponse> {
  return ask(`/v1/calibrations/${part(id)}/residuals`, { signal });
}

/** How a calibration is exported: as it is or with pinholes for undistorted images; how far a refitted lens may be off. */
export interface ExportOptions { undistorted: boolean; maxErrorPx: number }

function exportQuery({ undistorted, maxErrorPx }: ExportOptions): string {
  const query = new URLSearchParams();
  if (undistorted) query.set('undistorted', 'true');
  if (maxErrorPx > 0) query.set('max_error_px', String(maxErrorPx));
  const text = query.toString();
  return text ? `?${text}` : '';
}

/** The formats in which a calibration can be exported. */
export function listExports(id: string, options: ExportOptions, signal?: AbortSignal): Promise<ListExportsResponse> {
  return ask(`/v1/calibrations/${part(id)}/exports${exportQuery(options)}`, { signal });
}

/** Where a calibration can be downloaded in a format. */
export function exportAddress(id: string, format: string, options: ExportOptions): string {
  return `/v1/calibrations/${part(id)}/exports/${part(format)}${exportQuery(options)}`;
}

/** All rigs, each with its active calibration. */
export function listRigs(signal?: AbortSignal): Promise<ListRigsResponse> {
  return ask('/v1/rigs', { signal });
}

/** Which calibrations of a rig were active, newest first. */
export function listActivations(rig: string, signal?: AbortSignal): Promise<ListActivationsResponse> {
  return ask(`/v1/rigs/${part(rig)}/activations`, { signal });
}

/** Makes a calibration the active one of its rig; forced, also one that is bad or has other cameras. */
export async function activateCalibration(id: string, reason: string, force: boolean): Promise<Activation> {
  return (await ask<ActivateCalibrationResponse>(`/v1/calibrations/${part(id)}:activate`,
    { method: 'POST', body: { reason, force } })).activation ?? {};
}

/** Makes the calibration active again that was so before the present one. */
export async function rollbackRig(rig: string, reason: string, force: boolean): Promise<Activation> {
  return (await ask<RollbackRigResponse>(`/v1/rigs/${part(rig)}:rollback`, { method: 'POST', body: { reason, force } }))
    .activation ?? {};
}

/** Whether the server has the documentation, at /docs/. */
export async function hasDocs(signal?: AbortSignal): Promise<boolean> {
  const answer = await call('/docs.json', { signal });
  return (answer.json as { is_there?: boolean }).is_there === true;
}

/** The agents that are or were connected. */
export function listAgents(signal?: AbortSignal): Promise<ListAgentsResponse> {
  return ask('/v1/agents', { signal });
}

/** The next frame of a camera with the detection drawn into it, as an image. */
export async function getPreview(rig: string, camera: string, signal?: AbortSignal): Promise<Blob> {
  const answer = await call(`/v1/cameras/${part(camera)}/preview.jpg${query({ rig })}`,
    { signal, timeoutMs: 8000, binary: true });
  return answer.json as Blob;
}

/** A camera's detector: the colour it looks for, what it ignores, what it learns. */
export async function getDetector(rig: string, camera: string, signal?: AbortSignal): Promise<Detector> {
  return (await ask<GetDetectorResponse>(`/v1/cameras/${part(camera)}/detector${query({ rig })}`, { signal })).detector ?? {};
}

async function changeDetector(verb: string, rig: string, camera: string, fields: object = {}): Promise<Detector> {
  const body = { ...(rig ? { rig } : {}), ...fields };
  return (await ask<GetDetectorResponse>(`/v1/cameras/${part(camera)}/detector:${verb}`, { method: 'POST', body })).detector ?? {};
}

/** Begins to learn which static bright spots to ignore. */
export function learnMask(rig: string, camera: string): Promise<Detector> {
  return changeDetector('learn_mask', rig, camera);
}

/** Forgets the learnt mask. */
export function clearMask(rig: string, camera: string): Promise<Detector> {
  return changeDetector('clear_mask', rig, camera);
}

/** Begins to learn the colour of the wand. */
export function tuneDetector(rig: string, camera: string): Promise<Detector> {
  return changeDetector('tune', rig, camera);
}

/** Sets the colour of the wand; without one, that of the agent's configuration. */
export function setDetectorColour(rig: string, camera: string, colour?: ColourRange): Promise<Detector> {
  return changeDetector('set_colour', rig, camera, colour ? { colour } : {});
}

/** Has an agent use a camera that it offers; `lens` is the text of an OpenCV YAML, or empty. */
export async function useCamera(agentId: string, device: string, camera: string, lens: string): Promise<void> {
  await call(`/v1/cameras/${part(camera)}:use`,
    { method: 'POST', timeoutMs: 20000, body: { agent_id: agentId, device, ...(lens ? { calibration_yaml: lens } : {}) } });
}

/** Ends that; the camera is offered again. */
export async function dropCamera(rig: string, camera: string): Promise<void> {
  await call(`/v1/cameras/${part(camera)}:drop`, { method: 'POST', timeoutMs: 20000, body: rig ? { rig } : {} });
}

/** Makes a join string. */
export function createToken(request: CreateTokenRequest): Promise<CreateTokenResponse> {
  return ask('/v1/tokens', { method: 'POST', body: request });
}

/** Whether this person can make join strings here; '' : yes, else why not, and `loopback` where the server has no
 * port for others. */
export async function whyNobodyJoins(signal?: AbortSignal): Promise<{ loopback: boolean; problem: string }> {
  try {
    await call('/v1/tokens', { signal });
    return { loopback: false, problem: '' };
  } catch (error) {
    if (error instanceof ApiError && error.code === 'FAILED_PRECONDITION') return { loopback: true, problem: error.message };
    if (error instanceof ApiError && error.code === 'PERMISSION_DENIED') return { loopback: false, problem: error.message };
    throw error;
  }
}

/** Exchanges the token of a link for a cookie. */
export async function login(token: string): Promise<void> {
  await call('/v1/login', { method: 'POST', body: { token } });
}
