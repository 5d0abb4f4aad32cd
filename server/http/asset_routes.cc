// SPDX-License-Identifier: Apache-2.0
#include "server/http/asset_routes.h"

#include <spdlog/spdlog.h>

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/identity/private_key.h"
#include "server/api/gzip.h"
#include "server/http/content_type.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxAssetBytes = size_t{32} << 20;
constexpr size_t kHashBytes = 8;
constexpr int kSmallest = 9;

constexpr char kNoDashboard[] = R"(<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>rigcal</title></head>
<body>
<h1>rigcal</h1>
<p>The server runs. The dashboard is not built in: build with node and npm installed, or see
docs/api.md for the JSON API under <a href="/v1/status">/v1/status</a> and
<a href="/v1/openapi.json">/v1/openapi.json</a>.</p>
</body>
</html>
)";

struct Page {
  HttpResponse response;  // as it is asked for without its hash
  std::string hash;
};
using Pages = std::map<std::string, Page, std::less<>>;  // by name

bool HasHash(std::string_view name) { return name.starts_with("assets/"); }

Page MakePage(std::string_view name, std::string text, std::string gzipped) {
  Page page;
  page.hash = absl::BytesToHexString(Sha256(text).substr(0, kHashBytes));
  page.response = {.content_type = ContentTypeOf(name),
                   .body = std::move(text),
                   .gzipped = std::move(gzipped),
                   .etag = page.hash,
                   .cache_control = "no-cache"};
  return page;
}

std::shared_ptr<const Pages> MakePages(absl::Span<const WebAsset> assets) {
  auto pages = std::make_shared<Pages>();
  std::string index;
  for (const WebAsset& asset : assets) {
    absl::StatusOr<std::string> text = Gunzipped(asset.gzipped, kMaxAssetBytes);
    if (!text.ok()) {
      spdlog::error("the built-in file {} is damaged", asset.name);
    } else if (asset.name == "index.html") {
      index = *std::move(text);
    } else {
      (*pages)[std::string(asset.name)] =
          MakePage(asset.name, *std::move(text), std::string(asset.gzipped));
    }
  }
  if (index.empty()) index = kNoDashboard;
  for (const auto& [name, page] : *pages) {
    if (HasHash(name)) continue;
    // As in src="app.js" or href="/app.css".
    index = absl::StrReplaceAll(
        index,
        {{absl::StrCat("\"", name, "\""), absl::StrCat("\"/", name, "?v=", page.hash, "\"")},
         {absl::StrCat("\"./", name, "\""), absl::StrCat("\"/", name, "?v=", page.hash, "\"")},
         {absl::StrCat("\"/", name, "\""), absl::StrCat("\"/", name, "?v=", page.hash, "\"")}});
  }
  std::string gzipped = Gzipped(index, kSmallest);
  (*pages)["index.html"] = MakePage("index.html", std::move(index), std::move(gzipped));
  return pages;
}

HttpRoute RouteOf(const std::shared_ptr<const Pages>& pages, const std::string& path,
                  const std::string& name) {
  const Page* page = &pages->at(name);
  const bool has_hash = HasHash(name);
  return {.method = "GET",
          .path = path,
          .handle =
              [pages, page, has_hash](const HttpRequest& request) {
                HttpResponse response = page->response;
                if (has_hash || request.query == "v=" + page->hash) {
                  response.cache_control = "public, max-age=31536000, immutable";
                }
                return response;
              },
          .who = HttpRoute::For::kPages};
}

}  // namespace

std::vector<HttpRoute> AssetRoutes(absl::Span<const WebAsset> assets) {
  const std::shared_ptr<const Pages> pages = MakePages(assets);
  std::vector<HttpRoute> routes = {RouteOf(pages, "/", "index.html"),
                                   RouteOf(pages, "/login", "index.html")};
  if (pages->contains("pattern.html")) {
    routes.push_back(RouteOf(pages, "/pattern", "pattern.html"));
  }
  for (const auto& [name, page] : *pages) routes.push_back(RouteOf(pages, "/" + name, name));
  return routes;
}

}  // namespace rigcal::server
