// SPDX-License-Identifier: Apache-2.0
import { createContext } from 'preact';
import { useContext, useEffect, useState } from 'preact/hooks';
import type { FeedState, LiveFeed } from '../live/live_feed';

/** The page's one feed. */
export const FeedContext = createContext<LiveFeed | undefined>(undefined);

/** The feed itself, for what is asked of it. */
export function useFeedControl(): LiveFeed {
  const feed = useContext(FeedContext);
  if (!feed) throw new Error('no feed around this part of the page');
  return feed;
}

/** What the feed knows now; draws anew after each change. */
export function useFeed(): FeedState {
  const feed = useFeedControl();
  const [state, setState] = useState(feed.state);
  useEffect(() => {
    setState(feed.state);
    return feed.subscribe(() => setState(feed.state));
  }, [feed]);
  return state;
}
