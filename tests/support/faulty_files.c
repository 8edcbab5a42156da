/* A library put before the C library (LD_PRELOAD) that ends a process, or fills its disk, at a given
 * moment of its writing to one folder, for tests of disks.
 *
 * FAULTY_FOLDER: the folder, without links in its path; paths that are not absolute lie in it.
 * FAULTY_MOMENT: the process is killed at this moment, counted from 0. Moments come after every fsync of
 *   a file, which is before it is renamed, before every fsync of its folder, which is after, and
 *   before every unlink.
 * FAULTY_BYTES: the disk is full once this many bytes are written.
 * FAULTY_FREE: the bytes that are free on every disk, as programs are told.
 * FAULTY_SYNC: this fsync, counted from 0, and all after it fail.
 *
 * Renaming need not be caught, nor could it be: the program calls the kernel for it directly. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

static atomic_uint_fast64_t moments, written, syncs;

static uint64_t setting(const char *name)
{
    const char *text = getenv(name);
    return text ? strtoull(text, NULL, 10) : UINT64_MAX;
}

static int is_in_folder(const char *path)
{
    const char *folder = getenv("FAULTY_FOLDER");
    return folder && (path[0] != '/' || !strncmp(path, folder, strlen(folder)));
}

static int is_open_in_folder(int file)
{
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0 || path[0] != '/') return 0; /* a pipe or socket has a name without a slash */
    path[length] = 0;
    return is_in_folder(path);
}

static void moment(const char *name)
{
    uint64_t now = atomic_fetch_add(&moments, 1);
    if (now != setting("FAULTY_MOMENT")) return;
    dprintf(STDERR_FILENO, "killed %s\n", name);
    raise(SIGKILL);
}

int fsync(int file)
{
    int (*next)(int) = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
    if (!is_open_in_folder(file)) return next(file);
    struct stat found;
    int is_file = fstat(file, &found) == 0 && S_ISREG(found.st_mode);
    if (!is_file) moment("before a folder is synced");
    if (atomic_fetch_add(&syncs, 1) >= setting("FAULTY_SYNC")) {
        errno = EIO;
        return -1;
    }
    int result = next(file);
    if (is_file) moment("before a file is renamed");
    return result;
}

int unlink(const char *path)
{
    int (*next)(const char *) = (int (*)(const char *))dlsym(RTLD_NEXT, "unlink");
    if (is_in_folder(path)) moment("before a file is removed");
    return next(path);
}

ssize_t write(int file, const void *bytes, size_t count)
{
    ssize_t (*next)(int, const void *, size_t) =
        (ssize_t (*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    uint64_t limit = setting("FAULTY_BYTES");
    if (limit == UINT64_MAX || !is_open_in_folder(file)) return next(file, bytes, count);
    uint64_t before = atomic_load(&written);
    uint64_t left = limit > before ? limit - before : 0;
    if (count > 0 && left == 0) {
        errno = ENOSPC;
        return -1;
    }
    ssize_t result = next(file, bytes, count < left ? count : left);
    if (result > 0) atomic_fetch_add(&written, (uint64_t)result);
    return result;
}

int statvfs(const char *path, struct statvfs *found)
{
    int (*next)(const char *, struct statvfs *) =
        (int (*)(const char *, struct statvfs *))dlsym(RTLD_NEXT, "statvfs");
    int result = next(path, found);
    if (setting("FAULTY_FREE") != UINT64_MAX) found->f_bavail = setting("FAULTY_FREE") / found->f_frsize;
    return result;
}

int statvfs64(const char *path, struct statvfs64 *found)
{
    int (*next)(const char *, struct statvfs64 *) =
        (int (*)(const char *, struct statvfs64 *))dlsym(RTLD_NEXT, "statvfs64");
    int result = next(path, found);
    if (setting("FAULTY_FREE") != UINT64_MAX) found->f_bavail = setting("FAULTY_FREE") / found->f_frsize;
    return result;
}
