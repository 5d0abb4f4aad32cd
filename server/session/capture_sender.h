// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/session/session.h"
#include "common/session/stream_key.h"
#include "server/session/agent_directory.h"
#include "server/session/capture_orders.h"
#include "server/session/stream_context_cache.h"
#include "server/session/task_queue.h"

namespace rigcal::server {

// Sends agents the commands to start and to stop a capture: on the thread of a task queue, with no
// lock held, in the order of the calls. No call waits for an agent. Thread-safe.
class CaptureSender {
 public:
  // All must outlive the thread of `tasks`.
  CaptureSender(const AgentDirectory* directory, const StreamContextCache* contexts,
                TaskQueue* tasks)
      : directory_(*directory), contexts_(*contexts), tasks_(*tasks) {}

  // For a session that drains, the command to stop follows at once: the agent then delivers what it
  // still has.
  void SendStart(const Session& session, std::vector<CaptureOrder> orders);
  // To each connected agent that takes part in the session.
  void SendStop(const Session& session);
  // To the agent that delivers a stream whose session has ended, once for each connection: it was
  // away when the session was stopped.
  void SendLateStop(const StreamKey& stream);
  // The connection has ended.
  void Forget(AgentDirectory::Registration registration);

 private:
  void StopLateCapture(const StreamKey& stream);

  const AgentDirectory& directory_;
  const StreamContextCache& contexts_;
  TaskQueue& tasks_;
  std::mutex mutex_;
  // Connections and sessions of late deliveries that were answered with a stop command.
  std::set<std::pair<AgentDirectory::Registration, std::string>> late_stops_;
};

}  // namespace rigcal::server
