// SPDX-License-Identifier: Apache-2.0
import { render } from 'preact';
import { LiveFeed } from './live/live_feed';
import { App } from './shell/app';
import { FeedContext } from './shell/feed_context';
import { readSettings } from './shell/settings';
import './style/main.css';

const feed = new LiveFeed();
feed.start(readSettings().rig);
document.documentElement.dataset['theme'] = readSettings().theme;
const root = document.getElementById('page');
if (root) render(<FeedContext.Provider value={feed}><App /></FeedContext.Provider>, root);
