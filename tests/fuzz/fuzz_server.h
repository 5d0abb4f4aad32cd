// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <utility>

#include "server/ingest/ingest.h"
#include "server/rpc/rpc_server.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_registry.h"
#include "server/session/calibration_runner.h"
#include "server/session/session_coordinator.h"
#include "server/store/factory/open_store.h"
#include "tests/fuzz/fuzz_check.h"

namespace rigcal::testing {

// A server over a new store in `folder`, reached in the process. Its solver gives an empty result.
class FuzzServer {
 public:
  explicit FuzzServer(const std::filesystem::path& folder)
      : store_(Opened(server::OpenStore(folder.string(), {.min_free_bytes = 0}))),
        registry_(Opened(server::AgentRegistry::Open({.file = folder / "agents.json"}))),
        coordinator_(Opened(server::SessionCoordinator::Create({}, store_.get(), &directory_))),
        ingest_(
            {}, store_.get(),
            [this](const StreamKey& key) { return coordinator_->contexts().GetStreamContext(key); },
            [this](const StreamKey& key, const server::AppendOutcome& outcome) {
              coordinator_->RecordProgress(key, outcome);
            }),
        runner_(Opened(server::CalibrationRunner::Create({}, store_.get(), coordinator_.get(),
                                                         server::SolveInProcess(EmptyResult)))),
        rpc_(RpcOptions(), {.store = store_.get(),
                            .ingest = &ingest_,
                            .directory = &directory_,
                            .coordinator = coordinator_.get(),
                            .runner = runner_.get(),
                            .registry = registry_.get()}) {
    coordinator_->Start();
    ingest_.Start();
    runner_->Start();
    FUZZ_CHECK(rpc_.Start().ok());
  }
  ~FuzzServer() {
    rpc_.Shutdown(std::chrono::seconds(1));
    ingest_.Shutdown();
    runner_->Shutdown();
    coordinator_->Shutdown();
  }

  std::shared_ptr<grpc::Channel> Channel() { return rpc_.InProcessChannel(); }

 private:
  template <typename T>
  static T Opened(absl::StatusOr<T> result) {
    FUZZ_CHECK(result.ok());
    return *std::move(result);
  }
  static server::CalibrationOutcome EmptyResult(const server::CalibrationInput& input,
                                                const CalibrationOptions&,
                                                const server::CalibrationHooks&) {
    CalibrationResult result;
    result.target.given = input.target;
    return {std::move(result), input.refused};
  }
  static server::RpcServerOptions RpcOptions() {
    using std::chrono::milliseconds;
    server::RpcServerOptions options;
    options.endpoint.listen_address.clear();
    options.previews = {.default_wait = milliseconds(20),
                        .longest_wait = milliseconds(50),
                        .answer_grace = milliseconds(20)};
    options.detectors = {.longest_wait = milliseconds(20)};
    return options;
  }

  const std::unique_ptr<server::Store> store_;
  const std::unique_ptr<server::AgentRegistry> registry_;
  server::AgentDirectory directory_{{}};
  const std::unique_ptr<server::SessionCoordinator> coordinator_;
  server::Ingest ingest_;
  const std::unique_ptr<server::CalibrationRunner> runner_;
  server::RpcServer rpc_;
};

}  // namespace rigcal::testing
