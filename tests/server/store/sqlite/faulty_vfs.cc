// SPDX-License-Identifier: Apache-2.0
#include "tests/server/store/sqlite/faulty_vfs.h"

#include <sqlite3.h>

#include <cstdlib>

namespace rigcal::testing {
namespace {

// SQLite allocates szOsFile bytes: this, and the real file behind it.
struct FaultyFile {
  sqlite3_file base;
  const char* path;  // SQLite keeps it as long as the file is open
  sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};

sqlite3_file* Real(sqlite3_file* file) { return reinterpret_cast<FaultyFile*>(file)->real(); }
// The model, for files that have a name; null: nothing is noted.
UnsyncedFiles* ModelOf(sqlite3_file* file) {
  return reinterpret_cast<FaultyFile*>(file)->path == nullptr ? nullptr : FaultyVfs::Get().model();
}
std::string PathOf(sqlite3_file* file) { return reinterpret_cast<FaultyFile*>(file)->path; }
sqlite3_vfs* RealVfs(sqlite3_vfs* vfs) { return static_cast<sqlite3_vfs*>(vfs->pAppData); }

int Close(sqlite3_file* file) { return Real(file)->pMethods->xClose(Real(file)); }
int Read(sqlite3_file* file, void* data, int size, sqlite3_int64 offset) {
  if (FaultyVfs::Get().NextReadFault() != 0) return SQLITE_IOERR_READ;
  return Real(file)->pMethods->xRead(Real(file), data, size, offset);
}
int Write(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
  sqlite3_file* real = Real(file);
  sqlite3_int64 file_size = 0;
  real->pMethods->xFileSize(real, &file_size);
  if (offset + size > file_size && !FaultyVfs::Get().MayGrow()) return SQLITE_FULL;
  const int fault = FaultyVfs::Get().NextFault();
  const int written = fault == 0 ? size : size / 2;
  if (UnsyncedFiles* model = ModelOf(file)) {
    model->NoteWrite(PathOf(file), {static_cast<const char*>(data), static_cast<size_t>(written)},
                     offset);
  }
  const int result = real->pMethods->xWrite(real, data, written, offset);
  return fault == 0 ? result : fault;
}
int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (const int fault = FaultyVfs::Get().NextFault(); fault != 0) return fault;
  if (UnsyncedFiles* model = ModelOf(file)) model->NoteTruncate(PathOf(file), size);
  return Real(file)->pMethods->xTruncate(Real(file), size);
}
int Sync(sqlite3_file* file, int) {
  if (const int fault = FaultyVfs::Get().NextFault(); fault != 0) {
    return FaultyVfs::Get().SyncCode(fault);
  }
  FaultyVfs::Get().NoteSync();
  if (UnsyncedFiles* model = ModelOf(file)) model->NoteSync(PathOf(file));
  return SQLITE_OK;
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return Real(file)->pMethods->xFileSize(Real(file), size);
}
int Lock(sqlite3_file* file, int level) { return Real(file)->pMethods->xLock(Real(file), level); }
int Unlock(sqlite3_file* file, int level) {
  return Real(file)->pMethods->xUnlock(Real(file), level);
}
int CheckReservedLock(sqlite3_file* file, int* result) {
  return Real(file)->pMethods->xCheckReservedLock(Real(file), result);
}
int FileControl(sqlite3_file* file, int operation, void* argument) {
  return Real(file)->pMethods->xFileControl(Real(file), operation, argument);
}
int SectorSize(sqlite3_file* file) { return Real(file)->pMethods->xSectorSize(Real(file)); }
int DeviceCharacteristics(sqlite3_file* file) {
  return Real(file)->pMethods->xDeviceCharacteristics(Real(file));
}
int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** data) {
  return Real(file)->pMethods->xShmMap(Real(file), page, size, extend, data);
}
int ShmLock(sqlite3_file* file, int offset, int count, int flags) {
  return Real(file)->pMethods->xShmLock(Real(file), offset, count, flags);
}
void ShmBarrier(sqlite3_file* file) { Real(file)->pMethods->xShmBarrier(Real(file)); }
int ShmUnmap(sqlite3_file* file, int remove) {
  return Real(file)->pMethods->xShmUnmap(Real(file), remove);
}

const sqlite3_io_methods kMethods = {
    /*iVersion=*/2,
    Close,
    Read,
    Write,
    Truncate,
    Sync,
    FileSize,
    Lock,
    Unlock,
    CheckReservedLock,
    FileControl,
    SectorSize,
    DeviceCharacteristics,
    ShmMap,
    ShmLock,
    ShmBarrier,
    ShmUnmap,
    /*xFetch=*/nullptr,
    /*xUnfetch=*/nullptr};

int Open(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* out_flags) {
  file->pMethods = nullptr;
  reinterpret_cast<FaultyFile*>(file)->path = name;
  const int result = RealVfs(vfs)->xOpen(RealVfs(vfs), name, Real(file), flags, out_flags);
  if (result == SQLITE_OK) file->pMethods = &kMethods;
  return result;
}
int Delete(sqlite3_vfs* vfs, const char* name, int) {
  if (UnsyncedFiles* model = FaultyVfs::Get().model()) model->NoteDelete(name);
  return RealVfs(vfs)->xDelete(RealVfs(vfs), name, /*syncDir=*/0);
}
int Access(sqlite3_vfs* vfs, const char* name, int flags, int* result) {
  return RealVfs(vfs)->xAccess(RealVfs(vfs), name, flags, result);
}
int FullPathname(sqlite3_vfs* vfs, const char* name, int size, char* full) {
  return RealVfs(vfs)->xFullPathname(RealVfs(vfs), name, size, full);
}

}  // namespace

FaultyVfs& FaultyVfs::Get() {
  static FaultyVfs* vfs = new FaultyVfs();
  return *vfs;
}

FaultyVfs::FaultyVfs() : name_("faulty") {
  sqlite3_vfs* real = sqlite3_vfs_find(nullptr);
  auto* vfs = new sqlite3_vfs(*real);
  vfs->szOsFile = static_cast<int>(sizeof(FaultyFile)) + real->szOsFile;
  vfs->zName = name_.c_str();
  vfs->pNext = nullptr;
  vfs->pAppData = real;
  vfs->xOpen = Open;
  vfs->xDelete = Delete;
  vfs->xAccess = Access;
  vfs->xFullPathname = FullPathname;
  // Time, randomness and the like do not look at the vfs they are called with.
  if (sqlite3_vfs_register(vfs, /*makeDflt=*/0) != SQLITE_OK) std::abort();
}

void FaultyVfs::FailAt(int64_t operation, int code, bool lasting) {
  fault_count_ = 0;
  code_ = code;
  lasting_ = lasting;
  fail_at_ = operation_count_ + operation;
}

void FaultyVfs::Heal() {
  fail_at_ = 0;
  sync_code_ = 0;
  growth_allowed_ = nullptr;
  reads_fail_ = false;
}

int FaultyVfs::NextFault() {
  const int64_t operation = ++operation_count_;
  const int64_t fail_at = fail_at_;
  if (fail_at == 0 || operation < fail_at || (operation > fail_at && !lasting_)) return 0;
  ++fault_count_;
  return code_;
}

}  // namespace rigcal::testing
