/* Injects faults into the writes that a process makes below one folder, and keeps what a power cut
 * would leave. Loaded by LD_PRELOAD; tests/api/faults.rs drives it.
 *
 * FAULT_ROOT     the folder, as an absolute path
 * FAULT_CONTROL  a file of four 32-bit integers, which may be changed while the process runs:
 *                the number of writes so far, the first and the last write that fails, and errno
 * FAULT_SHADOW   if set: a folder that receives the content of each file, and the entries of each
 *                folder, whenever the process forces them to disk: INODE.data and INODE.dir
 *
 * Counted as writes: open with O_CREAT, write, pwrite, fsync, fdatasync, ftruncate, rename, mkdir. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

struct control { uint32_t count, first, last; int32_t error; };
static struct control *control;
static char root[PATH_MAX], shadow[PATH_MAX];
static size_t root_length;

#define REAL(name) ({ static typeof(&name) real; if (!real) real = dlsym(RTLD_NEXT, #name); real; })

__attribute__((constructor)) static void start(void) {
    const char *folder = getenv("FAULT_ROOT"), *file = getenv("FAULT_CONTROL"), *copy = getenv("FAULT_SHADOW");
    if (!folder || !file) return;
    snprintf(root, sizeof root, "%s", folder);
    root_length = strlen(root);
    if (copy) snprintf(shadow, sizeof shadow, "%s", copy);
    int fd = REAL(open)(file, O_RDWR | O_CLOEXEC);
    if (fd < 0) return;
    void *mapped = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (mapped != MAP_FAILED) control = mapped;
    close(fd);
}

static int is_below(const char *path) {
    return control && strncmp(path, root, root_length) == 0 && (path[root_length] == '/' || !path[root_length]);
}

static int is_ours(int fd) {
    char link[64], path[PATH_MAX];
    if (!control) return 0;
    int saved = errno;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    errno = saved;
    if (length < 0) return 0;
    path[length] = 0;
    return is_below(path);
}

/* Counts a write. If it is to fail, sets errno and returns 1. */
static int fails(int ours) {
    if (!ours) return 0;
    uint32_t number = __atomic_add_fetch(&control->count, 1, __ATOMIC_SEQ_CST);
    if (number < control->first || number > control->last) return 0;
    errno = control->error;
    return 1;
}

static void forget(const char *path, const char *end) {
    struct stat found;
    char name[PATH_MAX + 64];
    if (!*shadow || stat(path, &found)) return;
    snprintf(name, sizeof name, "%s/%llu.%s", shadow, (unsigned long long)found.st_ino, end);
    unlink(name);
}

/* What is on disk from now on. */
static void remember(int fd) {
    struct stat found;
    char draft[PATH_MAX + 64], name[PATH_MAX + 64], link[64];
    if (!*shadow || fstat(fd, &found)) return;
    int is_folder = S_ISDIR(found.st_mode);
    snprintf(name, sizeof name, "%s/%llu.%s", shadow, (unsigned long long)found.st_ino, is_folder ? "dir" : "data");
    snprintf(draft, sizeof draft, "%s.%d", name, gettid());
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    int out = REAL(open)(draft, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (out < 0) return;
    if (is_folder) {
        DIR *folder = opendir(link);
        struct dirent *entry;
        while (folder && (entry = readdir(folder)))
            if (strcmp(entry->d_name, ".") && strcmp(entry->d_name, ".."))
                dprintf(out, "%llu %c %s\n", (unsigned long long)entry->d_ino, entry->d_type == DT_DIR ? 'd' : 'f', entry->d_name);
        if (folder) closedir(folder);
    } else {
        char chunk[65536];
        int in = REAL(open)(link, O_RDONLY | O_CLOEXEC);
        ssize_t length;
        while (in >= 0 && (length = read(in, chunk, sizeof chunk)) > 0)
            if (REAL(write)(out, chunk, length) != length) abort();
        if (in >= 0) close(in);
    }
    close(out);
    REAL(rename)(draft, name);
}

static int opened(int (*real)(const char *, int, ...), const char *path, int flags, mode_t mode) {
    int creates = (flags & O_CREAT) && is_below(path);
    int is_new = creates && access(path, F_OK) != 0;
    if (fails(creates)) return -1;
    int fd = real(path, flags, mode);
    if (fd >= 0 && is_new) forget(path, "data");
    return fd;
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        mode_t mode = 0; \
        if (flags & (O_CREAT | O_TMPFILE)) { va_list list; va_start(list, flags); mode = va_arg(list, int); va_end(list); } \
        return opened(REAL(name), path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

ssize_t write(int fd, const void *bytes, size_t length) { return fails(is_ours(fd)) ? -1 : REAL(write)(fd, bytes, length); }
ssize_t pwrite(int fd, const void *bytes, size_t length, off_t at) { return fails(is_ours(fd)) ? -1 : REAL(pwrite)(fd, bytes, length, at); }
ssize_t pwrite64(int fd, const void *bytes, size_t length, off64_t at) { return fails(is_ours(fd)) ? -1 : REAL(pwrite64)(fd, bytes, length, at); }
int ftruncate(int fd, off_t length) { return fails(is_ours(fd)) ? -1 : REAL(ftruncate)(fd, length); }
int ftruncate64(int fd, off64_t length) { return fails(is_ours(fd)) ? -1 : REAL(ftruncate64)(fd, length); }
int rename(const char *from, const char *to) { return fails(is_below(from) || is_below(to)) ? -1 : REAL(rename)(from, to); }

int mkdir(const char *path, mode_t mode) {
    if (fails(is_below(path))) return -1;
    int made = REAL(mkdir)(path, mode);
    if (!made && is_below(path)) forget(path, "dir");
    return made;
}

#define SYNC(name) \
    int name(int fd) { \
        int ours = is_ours(fd); \
        if (fails(ours)) return -1; \
        int done = REAL(name)(fd); \
        if (!done && ours) remember(fd); \
        return done; \
    }
SYNC(fsync)
SYNC(fdatasync)
