// SPDX-License-Identifier: Apache-2.0
// Pages by hash: #/wave, #/result/c-000001?with=c-000002

export const pages = ['wave', 'result', 'rig', 'lens', 'records', 'join'] as const;
/** A page of the navigation, the distance mode, or the login. */
export type Page = (typeof pages)[number] | 'distance' | 'login';

/** Where in the dashboard one is. */
export interface Route {
  page: Page;
  /** What follows the page: an id. Empty: nothing. */
  id: string;
  parameters: URLSearchParams;
}

/** Reads a hash; what is not known leads to the wave. */
export function parseRoute(hash: string): Route {
  const [path = '', parameters = ''] = hash.replace(/^#\/?/, '').split('?', 2);
  const [page = '', id = ''] = path.split('/', 2);
  const known: readonly string[] = [...pages, 'distance', 'login'];
  let decoded = id;
  try {
    decoded = decodeURIComponent(id);
  } catch {
    // Kept as it is.
  }
  return { page: known.includes(page) ? (page as Page) : 'wave', id: decoded,
    parameters: new URLSearchParams(parameters) };
}

/** Where an address leads: by its hash, or to the login where the server was asked for /login. The
 * token of a link is in the hash, which browsers keep to themselves, or in the query. */
export function routeOf(address: { pathname: string; search: string; hash: string }): Route {
  if (address.pathname !== '/login') return parseRoute(address.hash);
  const parameters = new URLSearchParams(address.search);
  const hash = address.hash.replace(/^#(\/login\??)?/, '');
  if (hash.startsWith('rk1.')) parameters.set('token', hash);
  else for (const [name, value] of new URLSearchParams(hash)) parameters.set(name, value);
  return { page: 'login', id: '', parameters };
}

/** The hash of a page. */
export function hashOf(page: Page, id = '', parameters: Record<string, string> = {}): string {
  const query = new URLSearchParams(Object.entries(parameters).filter(([, value]) => value !== '')).toString();
  return `#/${page}${id === '' ? '' : `/${encodeURIComponent(id)}`}${query === '' ? '' : `?${query}`}`;
}
