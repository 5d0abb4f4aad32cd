// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/repeated_ptr_field.h>

#include <string>

#include "rigcal/v1/session_service.pb.h"

namespace rigcal::client {

// Sessions as people read them.

// Heads, a row per session.
std::string FormatSessionList(const rigcal::v1::ListSessionsResponse& response);
// One session with its cameras and what was refused.
std::string FormatWholeSession(const rigcal::v1::Session& session);
// The same, of a large rig without the cameras that need nothing (notable_cameras.h).
std::string FormatSession(const rigcal::v1::Session& session);
// One line: state and counts per camera; of a large rig their sums.
std::string FormatSessionLine(const rigcal::v1::Session& session);
// A table of refusals: camera, reason, count, example, below a line with `head`. Empty with none.
std::string FormatRefusals(
    const char* head, const google::protobuf::RepeatedPtrField<rigcal::v1::RefusalCount>& refusals);

}  // namespace rigcal::client
