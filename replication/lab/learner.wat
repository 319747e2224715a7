;; Q-learning (Eq. 1) for four actions: the loop of replication/learning/reference.py, the same bits.
;;
;; Memory holds the four words of the stream, and from 32 on a record for each state:
;;
;;    0  Q, f64 for each action
;;   32  rewards, f64 for each action
;;   64  moves, i32 for each action: where the record of the next state begins
;;   80  the largest Q, f64; 0 for the goal, whatever its Q
;;   88  the greedy choice, 12 bytes
;;  104  (the next record)
;;
;; So a state is the place of its record. Of k actions that are best, a draw x in [0, 1) takes number
;; floor(k x); byte floor(12 x) of the greedy choice is the same action, since 12 is divisible by 1,
;; 2, 3 and 4. It is made again only when an update has changed a value of the state: most updates
;; write the value that was there.
(module
  (memory (export "memory") 8)  ;; 512 KiB: 5,000 states

  (func $refresh (param $state i32) (param $tolerance f64) (param $random_ties i32)
    (local $best f64) (local $least f64) (local $action i32) (local $ties i32) (local $share i32)
    (local $slot i32) (local $end i32)
    (local.set $best (f64.max
      (f64.max (f64.load (local.get $state)) (f64.load offset=8 (local.get $state)))
      (f64.max (f64.load offset=16 (local.get $state)) (f64.load offset=24 (local.get $state)))))
    (f64.store offset=80 (local.get $state) (local.get $best))
    (local.set $least (f64.sub (local.get $best)
      (f64.mul (local.get $tolerance) (f64.abs (local.get $best)))))
    (local.set $share (i32.const 12))
    (if (local.get $random_ties)
      (then
        (local.set $share (i32.div_u (i32.const 12) (i32.add
          (i32.add
            (f64.ge (f64.load (local.get $state)) (local.get $least))
            (f64.ge (f64.load offset=8 (local.get $state)) (local.get $least)))
          (i32.add
            (f64.ge (f64.load offset=16 (local.get $state)) (local.get $least))
            (f64.ge (f64.load offset=24 (local.get $state)) (local.get $least))))))))
    (local.set $slot (local.get $state))
    (local.set $end (i32.add (local.get $state) (i32.const 12)))
    (loop $actions
      (if (f64.ge
            (f64.load (i32.add (local.get $state) (i32.shl (local.get $action) (i32.const 3))))
            (local.get $least))
        (then
          (local.set $ties (local.get $share))
          (loop $slots
            (i32.store8 offset=88 (local.get $slot) (local.get $action))
            (local.set $slot (i32.add (local.get $slot) (i32.const 1)))
            (br_if $slots (local.tee $ties (i32.sub (local.get $ties) (i32.const 1)))))))
      (local.set $action (i32.add (local.get $action) (i32.const 1)))
      (br_if $actions (i32.lt_u (local.get $slot) (local.get $end)))))

  ;; Returns the numbers of steps and of collisions. A step explores if the high half of its draw is
  ;; below $threshold.
  (func (export "learn")
    (param $states i32) (param $start i32) (param $goal i32) (param $episodes i32)
    (param $horizon i32) (param $beta f64) (param $gamma f64) (param $threshold f64)
    (param $tolerance f64) (param $random_ties i32)
    (result f64 f64)
    (local $s0 i64) (local $s1 i64) (local $s2 i64) (local $s3 i64) (local $word i64)
    (local $below i64) (local $low i64) (local $state i32) (local $next i32) (local $action i32)
    (local $left i32) (local $at i32) (local $q f64) (local $new f64)
    (local $steps i64) (local $collisions i64)
    (local.set $s0 (i64.load (i32.const 0)))
    (local.set $s1 (i64.load (i32.const 8)))
    (local.set $s2 (i64.load (i32.const 16)))
    (local.set $s3 (i64.load (i32.const 24)))
    (local.set $below (i64.trunc_f64_u (local.get $threshold)))
    (local.set $state (i32.const 32))
    (loop $all
      (call $refresh (local.get $state) (local.get $tolerance) (local.get $random_ties))
      (local.set $state (i32.add (local.get $state) (i32.const 104)))
      (br_if $all (local.tee $states (i32.sub (local.get $states) (i32.const 1)))))
    (f64.store offset=80 (local.get $goal) (f64.const 0))
    (loop $episode
      (local.set $state (local.get $start))
      (local.set $left (local.get $horizon))
      (block $ended
        (loop $step
          (local.set $left (i32.sub (local.get $left) (i32.const 1)))
          ;; xoshiro256++
          (local.set $word (i64.add (local.get $s0)
            (i64.rotl (i64.add (local.get $s0) (local.get $s3)) (i64.const 23))))
          (local.set $low (i64.shl (local.get $s1) (i64.const 17)))
          (local.set $s2 (i64.xor (local.get $s2) (local.get $s0)))
          (local.set $s3 (i64.xor (local.get $s3) (local.get $s1)))
          (local.set $s1 (i64.xor (local.get $s1) (local.get $s2)))
          (local.set $s0 (i64.xor (local.get $s0) (local.get $s3)))
          (local.set $s2 (i64.xor (local.get $s2) (local.get $low)))
          (local.set $s3 (i64.rotl (local.get $s3) (i64.const 45)))
          (local.set $low (i64.and (local.get $word) (i64.const 0xffffffff)))
          ;; the action
          (local.set $action
            (if (result i32)
              (i64.lt_u (i64.shr_u (local.get $word) (i64.const 32)) (local.get $below))
              (then (i32.wrap_i64 (i64.shr_u (local.get $low) (i64.const 30))))
              (else (i32.load8_u offset=88 (i32.add (local.get $state) (i32.wrap_i64
                (i64.shr_u (i64.mul (local.get $low) (i64.const 12)) (i64.const 32))))))))
          (local.set $next (i32.load offset=64
            (i32.add (local.get $state) (i32.shl (local.get $action) (i32.const 2)))))
          (local.set $collisions (i64.add (local.get $collisions)
            (i64.extend_i32_u (i32.eq (local.get $next) (local.get $state)))))
          ;; Eq. 1
          (local.set $at (i32.add (local.get $state) (i32.shl (local.get $action) (i32.const 3))))
          (local.set $q (f64.load (local.get $at)))
          (local.set $new
            (f64.add (local.get $q)
              (f64.mul (local.get $beta)
                (f64.sub
                  (f64.add (f64.load offset=32 (local.get $at))
                    (f64.mul (local.get $gamma) (f64.load offset=80 (local.get $next))))
                  (local.get $q)))))
          (if (i64.ne (i64.reinterpret_f64 (local.get $new)) (i64.reinterpret_f64 (local.get $q)))
            (then
              (f64.store (local.get $at) (local.get $new))
              (call $refresh
                (local.get $state) (local.get $tolerance) (local.get $random_ties))
              (f64.store offset=80 (local.get $goal) (f64.const 0))))
          (br_if $ended (i32.eq (local.get $next) (local.get $goal)))
          (local.set $state (local.get $next))
          (br_if $step (local.get $left))))
      (local.set $steps (i64.add (local.get $steps)
        (i64.extend_i32_u (i32.sub (local.get $horizon) (local.get $left)))))
      (br_if $episode (local.tee $episodes (i32.sub (local.get $episodes) (i32.const 1)))))
    (i64.store (i32.const 0) (local.get $s0))
    (i64.store (i32.const 8) (local.get $s1))
    (i64.store (i32.const 16) (local.get $s2))
    (i64.store (i32.const 24) (local.get $s3))
    (f64.convert_i64_u (local.get $steps))
    (f64.convert_i64_u (local.get $collisions))))
