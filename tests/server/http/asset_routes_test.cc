// SPDX-License-Identifier: Apache-2.0
#include "server/http/asset_routes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

#include "server/api/gzip.h"

namespace rigcal::testing::asset_routes_test {
namespace {

using server::HttpResponse;
using server::HttpRoute;
using server::WebAsset;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

HttpResponse Get(const std::vector<HttpRoute>& routes, const std::string& path,
                 const std::string& query = "") {
  const auto route = std::ranges::find(routes, path, &HttpRoute::path);
  if (route == routes.end()) return {.status = 404};
  return route->handle({.peer = "127.0.0.1", .method = "GET", .path = path, .query = query});
}

class AssetRoutes : public ::testing::Test {
 protected:
  const std::string index_ = server::Gzipped(
      "<script src=\"app.js\"></script><link href='x' href=\"/app.css\"> app.js", 9);
  const std::string script_ = server::Gzipped("start()", 9);
  const std::string style_ = server::Gzipped("body {}", 9);
  const std::vector<WebAsset> assets_ = {
      {"index.html", index_}, {"app.js", script_}, {"app.css", style_}};
};

TEST_F(AssetRoutes, ThePageNamesItsFilesByTheirHashes) {
  const std::vector<HttpRoute> routes = server::AssetRoutes(assets_);
  const HttpResponse page = Get(routes, "/");
  EXPECT_EQ(page.content_type, "text/html; charset=utf-8");
  EXPECT_EQ(page.cache_control, "no-cache");
  EXPECT_EQ(page.body, *server::Gunzipped(page.gzipped, 1 << 20));
  std::smatch match;
  ASSERT_TRUE(
      std::regex_search(page.body, match, std::regex("src=\"/app\\.js\\?(v=[0-9a-f]{16})\"")))
      << page.body;
  EXPECT_TRUE(std::regex_search(page.body, std::regex("href=\"/app\\.css\\?v=[0-9a-f]{16}\"")));
  EXPECT_EQ(Get(routes, "/login").body, page.body);
  const HttpResponse script = Get(routes, "/app.js", match[1]);
  EXPECT_THAT(script.cache_control, HasSubstr("immutable"));
  EXPECT_EQ(script.body, "start()");
  EXPECT_EQ(script.gzipped, script_);
  EXPECT_EQ(script.content_type, "text/javascript; charset=utf-8");
}

TEST_F(AssetRoutes, TheBlinkingBoardIsAPageOfItsOwn) {
  const std::string pattern = server::Gzipped("<canvas></canvas>", 9);
  std::vector<WebAsset> assets = assets_;
  EXPECT_EQ(Get(server::AssetRoutes(assets), "/pattern").status, 404u);
  assets.push_back({"pattern.html", pattern});
  const HttpResponse page = Get(server::AssetRoutes(assets), "/pattern");
  EXPECT_EQ(page.body, "<canvas></canvas>");
  EXPECT_EQ(page.content_type, "text/html; charset=utf-8");
}

TEST_F(AssetRoutes, OtherAddressesOfAFileAreAskedForAgain) {
  const std::vector<HttpRoute> routes = server::AssetRoutes(assets_);
  EXPECT_EQ(Get(routes, "/app.js").cache_control, "no-cache");
  EXPECT_EQ(Get(routes, "/app.js", "v=0123456789abcdef").cache_control, "no-cache");
  EXPECT_FALSE(Get(routes, "/app.js").etag.empty());
  EXPECT_NE(Get(routes, "/app.js").etag, Get(routes, "/app.css").etag);
  EXPECT_EQ(Get(routes, "/app.js.map").status, 404u);
}

TEST_F(AssetRoutes, WhatTheBundlerNamedByItsHashKeepsItsName) {
  const std::string index = server::Gzipped("<script src=\"assets/app-1A2B.js\"></script>", 9);
  const std::vector<WebAsset> assets = {{"index.html", index}, {"assets/app-1A2B.js", script_}};
  const std::vector<HttpRoute> routes = server::AssetRoutes(assets);
  EXPECT_THAT(Get(routes, "/").body, HasSubstr("src=\"assets/app-1A2B.js\""));
  EXPECT_THAT(Get(routes, "/assets/app-1A2B.js").cache_control, HasSubstr("immutable"));
}

TEST_F(AssetRoutes, WithoutTheDashboardAPageSaysSo) {
  const HttpResponse page = Get(server::AssetRoutes({}), "/");
  EXPECT_EQ(page.status, 200u);
  EXPECT_THAT(page.body, AllOf(HasSubstr("not built in"), Not(HasSubstr("<script"))));
}

TEST_F(AssetRoutes, WhatIsBuiltInCanBeServed) {
  for (const WebAsset& asset : server::BuiltInAssets()) {
    EXPECT_TRUE(server::Gunzipped(asset.gzipped, 32 << 20).ok()) << asset.name;
  }
  EXPECT_EQ(Get(server::AssetRoutes(server::BuiltInAssets()), "/").status, 200u);
}

}  // namespace
}  // namespace rigcal::testing::asset_routes_test
