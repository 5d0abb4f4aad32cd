// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/types/span.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// What the rows of a table belong to.
enum class TableOwner {
  kShared,       // to no record
  kSession,      // few rows of a session
  kStreams,      // many rows of a session, by stream; they are added and deleted, never changed
  kCalibration,  // to a calibration
  kActivations,  // to the history of a rig
};

// A table of a store. The columns are in the order of their kinds: numbers, texts, blobs.
struct StoredTable {
  const char* name;
  const char* numbers;  // names with commas between
  const char* texts;
  const char* blobs;
  const char* key;  // orders the rows, and names each
  TableOwner owner;
  // Which rows are of the record whose id is ?1; of kStreams: of the stream whose number is ?1.
  // Empty: all.
  const char* of_record;

  std::string Columns() const;
  int number_count() const;
  int text_count() const;
  int blob_count() const;
  int column_count() const { return number_count() + text_count() + blob_count(); }
  // "INSERT INTO ...(...) VALUES(?,...)".
  std::string Insertion() const;
};

// All tables of a store; those that others refer to stand first.
absl::Span<const StoredTable> StoredTables();
// Null: there is none of this name.
const StoredTable* FindStoredTable(std::string_view name);

// Adds a value to a CRC-32, so that values cannot run into each other.
void AddToDigest(std::string_view bytes, uint32_t* digest);
// Adds a row of the table's columns, whose values begin at column 0.
void AddToDigest(const StoredTable& table, SqlStatement& row, uint32_t* digest);

}  // namespace rigcal::server
