/* A pool of threads that stay, and split a piece of work among them. */
#ifndef GROUSER_THREADS_H
#define GROUSER_THREADS_H

#if defined(__unix__) || defined(__APPLE__)
#define GROUSER_PTHREADS 1
#include <pthread.h>
#include <sys/types.h>
#else
#define GROUSER_PTHREADS 0
#endif

enum { GROUSER_MAX_THREADS = 64 };

/* One of `parts` shares of the work, counted from 0. */
typedef void (*grouser_share)(void *work, int part, int parts);

typedef struct grouser_pool {
  int threads; /* the caller's among them */
#if GROUSER_PTHREADS
  pthread_t workers[GROUSER_MAX_THREADS];
  pthread_mutex_t lock;
  pthread_cond_t called, finished;
  pid_t process;
  grouser_share share;
  void *work;
  int parts, next, unfinished, stopping; /* shares of the work: all, the first that nobody has taken, those left */
#endif
} grouser_pool;

/* Starts threads - 1 workers, threads in [1, GROUSER_MAX_THREADS]; 0 if the system refuses one, and none are left. */
int grouser_pool_start(grouser_pool *pool, int threads);

/* Runs `parts` shares and returns when all are done; who is free takes the next one. The shares do not depend on what
 * runs them: where there are no threads, or they were lost to a fork, the caller runs them one after another. */
void grouser_pool_run(grouser_pool *pool, grouser_share share, int parts, void *work);

/* Shares that so many blocks of vehicles are best split into: whole crews, unless threads would be idle. */
int grouser_pool_parts(const grouser_pool *pool, int blocks);

void grouser_pool_stop(grouser_pool *pool);

#endif
