// SPDX-License-Identifier: Apache-2.0
#include "client/watch/live_mirror.h"

#include <algorithm>
#include <map>
#include <string>

namespace rigcal::client {

bool LiveMirror::Merge(const v1::LiveState& answer) {
  if (answer.full()) {
    state_ = answer;
    return true;
  }
  if (!answer.has_time()) return false;  // nothing but the revision
  state_.set_revision(answer.revision());
  *state_.mutable_time() = answer.time();
  state_.set_age_s(answer.age_s());
  std::map<std::string, v1::LiveCamera> cameras;
  for (v1::LiveCamera& camera : *state_.mutable_cameras()) {
    cameras[camera.camera()] = std::move(camera);
  }
  for (const std::string& removed : answer.removed_cameras()) cameras.erase(removed);
  for (const v1::LiveCamera& camera : answer.cameras()) cameras[camera.camera()] = camera;
  state_.clear_cameras();
  for (auto& [name, camera] : cameras) *state_.add_cameras() = std::move(camera);
  if (answer.has_session()) *state_.mutable_session() = answer.session();
  if (answer.has_overlap()) *state_.mutable_overlap() = answer.overlap();
  if (answer.has_estimate()) *state_.mutable_estimate() = answer.estimate();
  if (answer.has_alerts()) *state_.mutable_alerts() = answer.alerts();
  if (answer.has_agents()) *state_.mutable_agents() = answer.agents();
  if (answer.has_goal()) *state_.mutable_goal() = answer.goal();
  if (answer.has_monitor()) *state_.mutable_monitor() = answer.monitor();
  return true;
}

}  // namespace rigcal::client
