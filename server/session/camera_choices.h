// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/session/offer.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_questions.h"
#include "server/session/agent_registry.h"

namespace rigcal::server {

struct CameraChoicesOptions {
  // Calls that wait for an agent.
  size_t max_waiting = 32;
  // An agent opens a camera before it answers.
  std::chrono::milliseconds longest_wait{15'000};
};

// What connected agents offer, and what clients choose of it. Thread-safe.
class CameraChoices {
 public:
  struct Chosen {
    std::string agent_id;
    std::string rig;
  };

  // Both outlive this object. `registry` null: cameras belong to nobody.
  CameraChoices(CameraChoicesOptions options, const AgentDirectory* directory,
                const AgentRegistry* registry)
      : options_(options), directory_(*directory), registry_(registry) {}

  // Replaces what the agent offered before.
  void TakeOffer(AgentDirectory::Registration registration, const std::string& agent_id,
                 std::vector<OfferedCamera> cameras);
  // Empty: nothing, or it is not connected.
  std::vector<OfferedCamera> OffersOf(std::string_view agent_id) const;

  // Has the agent use a device; `agent_id` empty: the agent that offers it. The id of the request
  // is set here.
  //   INVALID_ARGUMENT     a name, or several agents offer the device
  //   NOT_FOUND            nobody offers it; names those there are
  //   ALREADY_EXISTS       the name is another camera's, or the device has another name
  //   FAILED_PRECONDITION  the agent is away, or in its words: not now, not this one
  //   RESOURCE_EXHAUSTED, ABORTED, CANCELLED, UNAVAILABLE  as of DetectorBroker::Ask
  absl::StatusOr<Chosen> Use(const std::string& agent_id, ChoiceRequest request,
                             const std::function<bool()>& is_cancelled);
  // Has the agent of a camera drop it; `rig` empty: the rig that has it. Errors as of Use.
  absl::StatusOr<Chosen> Drop(const std::string& rig, const std::string& camera,
                              const std::function<bool()>& is_cancelled);

  // One that nobody waits for, or from another agent than was asked, is dropped.
  void TakeAnswer(AgentDirectory::Registration registration, ChoiceAnswer answer) {
    const uint32_t id = answer.request_id;
    questions_.Take(registration, id, std::move(answer));
  }
  void AgentGone(AgentDirectory::Registration registration);
  // Ends every wait.
  void Shutdown() { questions_.Shutdown(); }

 private:
  struct Offer {
    AgentDirectory::Registration registration = 0;
    std::vector<OfferedCamera> cameras;
  };

  absl::StatusOr<std::string> AgentWith(const std::string& device) const;
  absl::Status CheckName(const AgentDirectory::ConnectedAgent& agent,
                         const std::string& camera) const;
  absl::StatusOr<Chosen> Ask(const std::string& agent_id, ChoiceRequest request,
                             const std::function<bool()>& is_cancelled);

  const CameraChoicesOptions options_;
  const AgentDirectory& directory_;
  const AgentRegistry* const registry_;
  mutable std::mutex mutex_;
  std::map<std::string, Offer, std::less<>> offers_;  // by agent_id
  AgentQuestions<ChoiceAnswer> questions_{"choice", options_.max_waiting, true};
};

}  // namespace rigcal::server
