"""The words that labs use for what a column is, in some fifteen languages, without accents and in small letters."""

from __future__ import annotations

WORDS: dict[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "set": """
            inputpos inputtorque inputvel input_pos input_torque input_vel
            bor cmd comandada command commanded consigna consigne dem demand demanded des desired gewenst
            goal impostata impostato iset istenen komut mandada mandado nset objetivo ordenada order ordered
            planned profil profile program programme ref reference req request requested set setcurrent
            setpoint setspeed soll solldrehzahl sollstrom sollwert sp sv target traj trajectory vorgabe
            icmd iqcmd iqref iqsoll iref isoll ncmd nref nsoll vsoll wref wsoll
            wanted zadana zadane zadany """,
        "time": """
            abszisse aika cas clock czas date datetime datum elapsed fecha heure hora ido micros millis saat
            sec seconds stamp t tempo temps tid tiempo tijd time timestamp timesec timeseconds timestamps ts uhrzeit
            horodatage horodate marcatemps mjd tow x_axis x_value xaxis xvalue zaman zeit zeitpunkt zeitstempel """,
        "speed": """
            angvel devir dq drehzahl dtheta erpm fordulatszam geschwindigkeit giri gyro hastighet hiz hizi
            istdrehzahl motordrehzahl motorspeed mrpm n nm1 nopeus rotacoes obratky obrotowa obroty omdrejningstal
            omega omegas omg otacky phidot predkosc qd qdot raddrehzahl regime rotacao rotacion rotation
            rotationspeed rotrate rpm snelheid spd speed speeds tacho tachometer thetadot toerental tours varvtal
            vel velo velocidad velocidade velocita velocities velocity vitesse w wheelspeed winkelgeschwindigkeit
            wm """,
        "angle": """
            angle angolo angular angulo count_enc counts drehwinkel enc encoder mechangle phi pos posicion
            position posizione q rotorangle theta ticks winkel """,
        "current": """
            adci akim akimi amp amperage ampere amperes amps aram corrente corriente courant cur curr
            current current_raw currents i i_q ia iadc idc iin im imot imotor irms intensidad intensite iq isense
            iststrom motorcurrent motorstrom phasecurrent prad pradu proud stroem strom stroom virta """,
        "supply": """
            akku alim alimentacao hv alimentacion alimentation alimentazione bat bateria batt batteria batterie
            battery besleme bus charge dc eingang eingangs entrada entrata entree eps fuente ibus idc iin in input
            line mains netz netzteil ps psu quiescent source supply total versorgung voeding zasilania zasilanie
            amperagelatest zwischenkreis """,
        "phase": """
            fase faz faza ia ib ic iu iv iw leiterstrom phase phasen phases strang """,
        "armature": """
            anker armature indotto induit inducido """,
        "torque_axis": """
            iq q i_q wirk """,
        "torque": """
            couple drehmoment effort koppel kraftmoment moment par tau torque tq trq """,
        "force": """
            force kraft thrust """,
        "voltage": """
            armature gerilim gerilimi motorvoltage napeti napiecie spanning spannung tensao tension tensione
            u uq v vm vmot volt voltage voltaje volts vq """,
        "bus": """
            bat batt battery bus dc input netzteil psu supply ubat vbat vbus vdd versorgung vin """,
        "share": """
            duty dutycycle pwm throttle """,
        "temperature": """
            bearingtemp lagertemperatur motortemp sicaklik t_motor temp temperatur temperatura temperature
            temperatuur temps_c teplota tmot tmotor tmp """,
        "place": """
            ambient amb bearing brg case coil fet gehaeuse heatsink housing lager magnet mosfet pcb raum room shell
            stator winding wicklung """,
        "pressure": """
            druck presion press pression pressure vacuum """,
        "direction": """
            ccw cw dir direction drehrichtung forward reverse richtung sens sense senso sentido sign
            vorwaerts """,
        "segment": """
            cycle essai experiment lauf run run_id segment test_no trial versuch """,
        "count": """
            count counter id idx index line no nr number packet record row sample samples seq step tick timestep
            timesteps """,
        "direct": """
            d daxis feldbildend fieldgenerating fieldproducing fluxproducing id magnetising magnetizing reactive ud
            vd """,
        "neither": """
            amphour amphours ddot efficiency energie energy err error fehler leistung potencia power puissance
            overshoot settling watthour watthours wirkungsgrad """,
        "derived": """
            abs acc accel acceleration analog analogue average averaged avg derivative diff err error est estimate
            estimated filt filtered gefiltert hat kalman limit lp max mean min moyenne observer peak predicted sigma
            simulated smooth smoothed std """,
        "aside": """
            abweichung acc accel acceleration accumulated alpha band beta bias ceiling change cum cumulative
            currentdot currentrate cutoff delta deviation diff difference differenz fft gradient grenzwert idot
            initial int integ integral integrated lim limit limite limited max min ndot next noise nom nominal norm
            normalised normalized normiert offset old omegadot omegarate prev previous rated ratio ripple rpmdot
            rpmrate sigma slope speeddot speedrate sq squared stall start std sum threshold tolerance variance
            veldot velocitydot velocityrate velrate wdot zero anteil begrenzung deslizamiento feedforward ff
            glissement schlupf scorrimento slip vorsteuerung """,
        "controller": """
            angle attitude controller err error fehler heading integ integral integrator omega phi pid pitch pos
            position psi rate regler roll rpm spd speed term theta vel velo velocity yaw """,
        "countdown": """
            countdown left remaining rest restant restante restzeit togo verbleibend """,
        "raw": """
            act actual dreh fb feedback gemeten ist istwert meas measured medida mess momentan roh medido mesure
            misurata misurato olculen raw real zmierzona zmierzony """,
        "machine": """
            achs antriebs flywheel kolo laeufer m mot moteur motor motoru rad rotor roue rw schwungrad shaft silnik
            silnika vliegwiel volan volano volante welle wellen wheel """,
        "other_load": """
            aux brake charger coil controller cpu dyno excitation fan field fuse generator ground gyro heater heizung
            host imu laser leak leakage led load logic magnet magnetorquer mcu model mtq obc panel pcb predicted pump
            radio sim simulated solar standby """,
        "other_machine": """
            abtrieb abtriebsdrehzahl arm base body cadence crank dyno fan gear gearbox getriebe gimbal gyro imu kadenz
            load model output pedal pend pendulum pitch plate platform predicted pump roll sat satellite sim simulated
            spacecraft spindle turntable yaw """,
        "plain": """
            active and ang angular ave chan channel col column corrected data del der des die digital dot drive
            elec electrical emf for from hex log logged measurement mech mechanical motion new now num optical per
            present producing quadrature reading readings revolution revolutions rotary rotating rotational sensor
            signal strom table the used val value values var vom von """,
        "linear": """
            distance gyro gyrox gyroy gyroz imu meters air car gnss gps ground linear vehicle wind """,
    }.items()
}

# Signs of other scripts, and pieces of words, by what they stand for.
SIGNS = {
    "轉速": " speed ", "转速": " speed ", "速度": " speed ", "電流": " current ", "电流": " current ", "時間": " time ",
    "时间": " time ", "時刻": " time ", "電壓": " voltage ", "电压": " voltage ", "轉矩": " torque ",
    "转矩": " torque ", "扭矩": " torque ", "温度": " temperature ", "溫度": " temperature ", "시간": " time ",
    "회전속도": " speed ", "속도": " speed ", "전류": " current ", "전압": " voltage ", "온도": " temperature ",
    "전원": " supply ", "모터": " motor ", "지령": " set ", "목표": " set ", "휠": " wheel ", "ı": "i", "ł": "l",
    "角度": " angle ", "指令": " command ", "目标": " target ", "设定": " set ", "给定": " set ", "目標": " set ",
    "电源": " supply ",
    "供电": " supply ", "母线": " bus ", "电机": " motor ", "電機": " motor ", "实际": " actual ", "飞轮": " wheel ",
    "轴承": " bearing ", "время": " time ", "частота вращ": " speed ", "скорост": " speed ", "оборот": " speed ",
    "ток ": " current ", "двигател": " motor ", "потреб": " supply ", "питан": " supply ",
    "источник": " supply ", "задан": " set ", "момент": " torque ", "напряж": " voltage ",
    "темп": " temperature ", "угол": " angle ", "мах": " wheel ", "モータ": " motor ", "電源": " supply ",
    "回転": " speed ", "ホイール": " wheel ", "ω": " omega ", "Ω": " omega ", "θ": " theta ", "φ": " phi ",
    "I2t": " i integral ", "i2t": " i integral ", "I²t": " i integral ",
    "フィードバック": " actual ", "フライ": " ", "输出": " output ", "出力": " output ", "驱动": " drive ",
    "駆動": " drive ", "구동": " drive ", "平均": " average ", "电枢": " armature ", "電機子": " armature ",
    "速": " speed ", "축": " shaft ", "主": " ", "实测": " actual ", "测量": " actual ", "反馈": " actual ",
    "当前": " actual ", "实时": " actual ", "測定": " actual ", "検出": " actual ", "現在": " actual ",
    "実": " actual ", "측정": " actual ", "실제": " actual ", "현재": " actual ", "入力": " input ", "输入": " input ",
    "輸入": " input ", "总": " total ", "總": " total ", "电池": " battery ", "電池": " battery ",
    "バッテリ": " battery ", "负载": " load ", "負載": " load ", "負荷": " load ", "摩擦": " friction ",
    "电角": " electrical ", "電気": " electrical ", "励磁": " excitation ", "トルク": " torque ", "電動機": " motor ",
    "轴": " shaft ", "軸": " shaft ", "ロータ": " rotor ", "转子": " rotor ", "リアクション": " ", "反作用": " ",
    "动量": " ", "轮": " wheel ", "회전": " speed ", "値": " ", "值": " ", "数": " ", "數": " ", "수": " ", "角": " ",
    "毎分": " ", "ー": " ", "の": " ",
    "đ": "d", "Đ": "D", "ø": "oe", "τ": " tau ", "相": " phase ", "ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss",
}  # fmt: skip

# Which way a wheel turns; R is right beside L, and reverse beside F.
FORWARD = frozenset({
    "+", "+1", "1", "cw", "f", "fwd", "forward", "forwards", "pos", "positive", "right", "rechts", "vor", "vorwaerts",
    "vorwärts", "true", "up", "avant", "horaire", "orario", "horario",
})  # fmt: skip
BACKWARD = frozenset({
    "-", "-1", "0", "ccw", "b", "back", "backward", "backwards", "rev", "reverse", "neg", "negative", "left", "l",
    "links", "zurueck", "rückwärts", "false", "down", "arriere", "arrière", "antihoraire",
    "anti-horaire", "antiorario", "antihorario",
})  # fmt: skip
STOPPED = frozenset({"stop", "stopped", "still", "rest", "standstill", "halt", "idle", "stillstand"})
