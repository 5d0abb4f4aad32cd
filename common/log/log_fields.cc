// SPDX-License-Identifier: Apache-2.0
#include "common/log/log_fields.h"

namespace rigcal {
namespace {

LogFields& FieldsOfThread() {
  thread_local LogFields fields;
  return fields;
}

}  // namespace

const LogFields& LogFields::Current() { return FieldsOfThread(); }

LogScope::LogScope(const LogFields& fields) : before_(FieldsOfThread()) {
  LogFields& now = FieldsOfThread();
  for (std::string LogFields::*const field : {&LogFields::session, &LogFields::camera,
                                              &LogFields::calibration, &LogFields::correlation}) {
    if (!(fields.*field).empty()) now.*field = fields.*field;
  }
}

LogScope::~LogScope() { FieldsOfThread() = std::move(before_); }

}  // namespace rigcal
