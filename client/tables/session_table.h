// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/repeated_ptr_field.h>

#include <string>

#include "rigcal/v1/session.pb.h"

namespace rigcal::client {

// Sessions as people read them.

// "capturing"; a number of a later version as such.
std::string SessionStateName(rigcal::v1::Session::State state);
// Heads, a row per session.
std::string FormatSessionList(
    const google::protobuf::RepeatedPtrField<rigcal::v1::Session>& sessions);
// One session with its cameras and what was refused.
std::string FormatSession(const rigcal::v1::Session& session);
// One line: state and counts per camera.
std::string FormatSessionLine(const rigcal::v1::Session& session);
// A table of refusals: camera, reason, count, example. Empty with none.
std::string FormatRefusals(
    const google::protobuf::RepeatedPtrField<rigcal::v1::RefusalCount>& refusals, int indent);

}  // namespace rigcal::client
