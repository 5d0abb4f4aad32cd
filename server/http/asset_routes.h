// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "absl/types/span.h"
#include "server/http/http_request.h"

namespace rigcal::server {

// A file of the dashboard, compressed with gzip when the server was built.
struct WebAsset {
  std::string_view name;  // "app.js", "icons/rig.svg"
  std::string_view gzipped;
};

// The files that this server was built with; empty: without the dashboard.
absl::Span<const WebAsset> BuiltInAssets();

// Serves them: index.html at "/" and "/login", pattern.html at "/pattern", the others under their
// names. What has a hash in its address is kept by browsers for good: all in assets/, where the
// bundler names files so, and
// "/app.js?v=1f2e...", as index.html is made to name others. The rest is asked for again and
// answered with 304. Without assets "/" is a page that says so.
std::vector<HttpRoute> AssetRoutes(absl::Span<const WebAsset> assets);

}  // namespace rigcal::server
