// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "server/access/access_rules.h"
#include "server/api/api_gateway.h"

namespace rigcal::testing {

// Answers each call with what was asked, as JSON; or keeps it until it is let go.
class EchoGateway final : public server::ApiGateway {
 public:
  void Call(server::ApiRequest request, std::function<void(Work)> done) override {
    nlohmann::ordered_json json = {{"rpc", std::string(request.route->rpc)},
                                   {"body", request.body},
                                   {"known_etag", request.known_etag},
                                   {"caller", request.peer.name}};
    for (const auto& [name, value] : request.variables) json["variables"][name] = value;
    for (const auto& [name, value] : request.parameters) json["parameters"][name] = value;
    const absl::Status status = Check(request.peer, request.route->rpc);
    auto body = std::make_shared<server::ApiBody>(server::ApiBody{json.dump() + padding, ""});
    std::function<void()> answer = [status, body, done = std::move(done), etag = etag] {
      done([=] { return server::ApiAnswer{.status = status, .body = body, .etag = etag}; });
    };
    ++calls;
    const std::lock_guard lock(mutex_);
    if (keep) {
      kept_.push_back(std::move(answer));
    } else {
      answer();
    }
  }
  absl::Status Check(const server::Peer& peer, std::string_view rpc) override {
    return server::CheckAccess(peer, rpc);
  }
  void LetGo() {
    const std::lock_guard lock(mutex_);
    for (const auto& answer : kept_) answer();
    kept_.clear();
  }

  std::atomic<int> calls = 0;
  std::atomic<bool> keep = false;
  std::string etag;
  std::string padding;

 private:
  std::mutex mutex_;
  std::vector<std::function<void()>> kept_;
};

}  // namespace rigcal::testing
