/* Notes what a process has had on its disk: at each sync of a file, by whomever in the process, how
   long it was, or the whole of it; at each sync of a folder, which names were in it. For LD_PRELOAD;
   CHAOS_SYNCS is the folder of the notes. benchmarks/chaos/power.py reads them. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int note_of(const char *path, const char *kind, char *note, size_t size) {
    const char *folder = getenv("CHAOS_SYNCS");
    if (!folder)
        return -1;
    int begun = snprintf(note, size, "%s/", folder);
    snprintf(note + begun, size - begun, "%s.%s", path, kind);
    for (char *c = note + begun; *c; c++)
        if (*c == '/')
            *c = '%';
    return 0;
}

static int ends(const char *path, const char *with) {
    size_t length = strlen(path), tail = strlen(with);
    return length >= tail && !strcmp(path + length - tail, with);
}

/* The note takes the place of the one before in one step: a process may be killed meanwhile. */
static FILE *begun(const char *note, char *draft, size_t size) {
    snprintf(draft, size, "%s.%d", note, gettid());
    return fopen(draft, "w");
}

static void done(FILE *file, const char *draft, const char *note) {
    if (!fclose(file))
        rename(draft, note);
}

static void note_names(const char *path) {
    char note[PATH_MAX], draft[PATH_MAX];
    DIR *folder = opendir(path);
    FILE *file = folder && !note_of(path, "names", note, sizeof note)
                     ? begun(note, draft, sizeof draft) : NULL;
    if (file) {
        for (struct dirent *each; (each = readdir(folder));)
            fprintf(file, "%s\n", each->d_name);
        done(file, draft, note);
    }
    if (folder)
        closedir(folder);
}

/* How long a log of SQLite is without what is left of the one before it, which a log that was begun
   anew writes over from its beginning: each frame has the salt of its log (sqlite.org/fileformat). */
static off_t in_log(int fd, off_t length, const unsigned char *head) {
    off_t frame = 24 + ((off_t)head[8] << 24 | head[9] << 16 | head[10] << 8 | head[11]);
    off_t from = 0, to = (length - 32) / frame;
    unsigned char salt[8];
    if (length <= 32)
        return length;
    while (from < to) {
        off_t middle = (from + to) / 2;
        int own = pread(fd, salt, 8, 32 + middle * frame + 8) == 8 && !memcmp(salt, head + 16, 8);
        if (own)
            from = middle + 1;
        else
            to = middle;
    }
    return 32 + from * frame;
}

/* A log is known by its first 32 bytes, which change when SQLite begins it anew. */
static void note_log(const char *path, off_t length, const unsigned char *head) {
    char note[PATH_MAX], draft[PATH_MAX];
    if (note_of(path, "length", note, sizeof note))
        return;
    FILE *file = begun(note, draft, sizeof draft);
    if (!file)
        return;
    fprintf(file, "%lld ", (long long)length);
    for (int i = 0; i < 32; i++)
        fprintf(file, "%02x", head[i]);
    done(file, draft, note);
}

/* Read by the descriptor itself where that can be: closing another one of a database would take
   SQLite's locks away. */
static void note_whole(const char *path, int fd) {
    char note[PATH_MAX], draft[PATH_MAX], piece[65536];
    if (note_of(path, "whole", note, sizeof note))
        return;
    int own = pread(fd, piece, 1, 0) < 0 ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    int from = own < 0 ? fd : own;
    FILE *file = begun(note, draft, sizeof draft);
    if (file) {
        off_t at = 0;
        for (ssize_t got; (got = pread(from, piece, sizeof piece, at)) > 0; at += got)
            fwrite(piece, 1, got, file);
        done(file, draft, note);
    }
    if (own >= 0)
        close(own);
}

static int noted(int fd, const char *call) {
    int (*sync)(int) = dlsym(RTLD_NEXT, call);
    char link[64], path[PATH_MAX];
    unsigned char head[32] = {0};
    struct stat before;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    int known = length > 0 && !fstat(fd, &before);
    path[known ? length : 0] = 0;
    off_t synced = known ? before.st_size : 0; /* what is written meanwhile need not be there */
    if (known && ends(path, "-wal") && pread(fd, head, sizeof head, 0) == sizeof head)
        synced = in_log(fd, synced, head);
    int failed = sync(fd);
    if (failed || !known)
        return failed;
    if (S_ISDIR(before.st_mode))
        note_names(path);
    else if (ends(path, "-wal") || ends(path, ".jsonl"))
        note_log(path, synced, head);
    else if (S_ISREG(before.st_mode))
        note_whole(path, fd);
    return 0;
}

/* One after the other, so that an older note does not come after a newer one. */
static int alone(int fd, const char *call) {
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    pthread_mutex_lock(&lock);
    int failed = noted(fd, call);
    pthread_mutex_unlock(&lock);
    return failed;
}

int fsync(int fd) { return alone(fd, "fsync"); }

int fdatasync(int fd) { return alone(fd, "fdatasync"); }
