// SPDX-License-Identifier: Apache-2.0
#include "server/http/waiting_routes.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace rigcal::server {
namespace {

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

HttpResponse WaitingPage(const WaitingNotice& notice) {
  const std::string link = notice.active_page.empty()
                               ? ""
                               : absl::StrCat("<p><a href=\"", Escaped(notice.active_page),
                                              "\">Go to ", Escaped(notice.active_page), "</a></p>");
  return {.status = 503,
          .content_type = "text/html; charset=utf-8",
          .body = absl::StrCat(
              "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>rigcal: ",
              Escaped(notice.title),
              "</title><meta name=\"viewport\" content=\"width=device-width\"><meta "
              "http-equiv=\"refresh\" content=\"2\"></head><body><h1>",
              Escaped(notice.title), "</h1><p>", Escaped(notice.message), "</p>", link,
              "</body></html>\n")};
}

}  // namespace

std::vector<HttpRoute> WaitingRoutes(const std::function<WaitingNotice()>& notice) {
  const auto refuse = [notice](const HttpRequest&) {
    return ErrorResponse(503, absl::UnavailableError(notice().message));
  };
  const auto page = [notice](const HttpRequest&) { return WaitingPage(notice()); };
  const auto metrics = [notice](const HttpRequest&) {
    const WaitingNotice now = notice();
    if (now.metrics.empty()) return ErrorResponse(503, absl::UnavailableError(now.message));
    return HttpResponse{.content_type = "text/plain; version=0.0.4; charset=utf-8",
                        .body = now.metrics};
  };
  return {{.method = "GET",
           .path = "/healthz",
           .handle = [](const HttpRequest&) { return HttpResponse{.body = "waiting\n"}; }},
          {.method = "GET", .path = "/readyz", .handle = refuse},
          {.method = "GET", .path = "/metrics", .handle = metrics},
          {.method = "GET", .path = "/", .handle = page, .who = HttpRoute::For::kPages},
          {.method = "GET", .path = "/login", .handle = page, .who = HttpRoute::For::kPages},
          {.method = "", .path = "/v1/*", .handle = refuse}};
}

}  // namespace rigcal::server
